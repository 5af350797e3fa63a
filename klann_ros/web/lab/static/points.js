'use strict';
/* A file with its points by coordinates in one pose, as one with bars: see linkage/points.py. */

const MIN_DISTANCE = 1e-9;
const LINE_TOLERANCE = 1e-3;
// Largest sine of a dyad in line, by coordinates that are rounded.
const MIN_POSE_SINE = 1e-4;

function mapped(mapping, change) {
  const copy = Object.create(null);
  for (const [key, value] of Object.entries(mapping)) copy[key] = change(value, key);
  return copy;
}

/** Return the content of a file with pivots, bodies and start in the place of points. */
function byBars(content) {
  const { points, ground, links, ...others } = content;
  if (!points) return content;
  const { turn } = unitsOf(content);
  const bodies = mapped(links, (link) => (Array.isArray(link) ? { points: link } : link));
  // The points of each link, the one from which its bars start first.
  const lists = mapped(bodies, ({ points: own = [], slides }, name) => {
    const pivot = name === content.crank && own.find((point) => ground.includes(point));
    return [...new Set([pivot || (slides ? slides.to : own[0]), ...own])];
  });
  const all = Object.keys(points);
  const unused = new Set(all);
  const use = (place, own) => {
    for (const point of own)
      if (!(point in points)) {
        const list = printable(all.join(', '), 200);
        wrong(
          place,
          `${point} is none of the points: ${list}`,
          `${point} não é um dos pontos: ${list}`,
        );
      } else unused.delete(point);
  };
  use('ground', ground);
  for (const [name, { slides }] of Object.entries(bodies))
    use(`links.${name}`, slides ? [...lists[name], slides.from] : lists[name]);
  for (const point of unused)
    wrong(
      `points.${point}`,
      'it is on no link, and not on the ground',
      'não está em nenhuma peça, nem no chão',
    );
  const vector = (from, to) => C.sub(points[to], points[from]);
  const size = Math.max(...all.map((point) => C.abs(vector(all[0], point))));
  const rod = (name, from, to) => {
    const way = vector(from, to);
    if (!(C.abs(way) > MIN_DISTANCE * size))
      wrong(
        `links.${name}`,
        `${from} and ${to} are in the same place: leave one of them out`,
        `${from} e ${to} estão no mesmo lugar: retire um deles`,
      );
    return way;
  };
  // The direction from which the bends of a link count.
  const directionOf = (name, depth = 0) => {
    if (!(name in bodies) || name === GROUND || depth > all.length) return [1, 0];
    if (bodies[name].slides) return directionOf(bodies[name].slides.along, depth + 1);
    const [from, to] = lists[name];
    if (!to)
      wrong(
        `links.${name}`,
        'a link that turns has 2 points or more',
        'uma peça que gira tem 2 pontos ou mais',
      );
    const way = rod(name, from, to);
    return C.times(1 / C.abs(way), way);
  };
  // The line that a link slides along, and the distance.
  const lineOf = (slides, place) => {
    const { from, to } = slides;
    const way = C.div(vector(from, to), directionOf(slides.along));
    const length = C.abs(way);
    if (!('direction' in slides)) {
      if (!(length > LINE_TOLERANCE * size))
        wrong(
          place,
          `${from} and ${to} are too close to tell the direction of the line: state it`,
          `${from} e ${to} estão próximos demais para dizer a direção da reta: declare-a`,
        );
      return [{ ...slides, direction: C.arg(way) / turn }, length];
    }
    const [along, off] = C.mul(way, C.polar(1, -turn * slides.direction));
    const gap = Math.abs(off);
    if (gap > LINE_TOLERANCE * size)
      wrong(
        place,
        `${to} is ${general(gap, 3)} off the line through ${from} in this direction`,
        `${to} está a ${general(gap, 3)} da reta por ${from} nesta direção`,
      );
    return [slides, along];
  };
  const start = Object.create(null);
  return {
    ...others,
    pivots: Object.fromEntries(ground.map((name) => [name, points[name]])),
    bodies: mapped(bodies, ({ points: _, ...body }, name) => {
      const direction = directionOf(name);
      const [from, ...ends] = lists[name];
      const bars = ends.map((to, n) => {
        const way = rod(name, from, to);
        const bar = { from, to, length: C.abs(way) };
        if (n || body.slides) bar.bend = C.arg(C.div(way, direction)) / turn;
        return bar;
      });
      if (bars.length) body.bars = bars;
      start[name] = ((body.clockwise ? -1 : 1) * C.arg(direction)) / turn;
      if (body.slides)
        [body.slides, start[name]] = lineOf(body.slides, `links.${name}.slides.direction`);
      return body;
    }),
    start,
  };
}

/** Return a linkage in the assembly of its points; at a dead point the one that is stated. */
function atPoints(plain, start, signs) {
  const u = plain.vectors(start);
  const sines = plain.blocks.map((block) => block.sine(u));
  const isSingular = (sine) => Math.abs(sine) <= MIN_POSE_SINE;
  const k = sines.findIndex(isSingular);
  if (k < 0) return reachedFrom(plain, start, signs, true);
  const list = plain.blocks[k].unknowns.map((j) => plain.structure.angles[j]).join(', ');
  refuseUnless(
    plain.isDyadic &&
      signs &&
      signs.length === sines.length &&
      sines.every((sine, b) => isSingular(sine) || sine * signs[b] > 0),
    `the points are at a dead point of ${list}, from which two motions go on: state one of them by assembly, or give another pose`,
    `os pontos estão num ponto morto de ${list}, do qual seguem dois movimentos: declare um deles com assembly, ou dê outra posição`,
  );
  return plain.with(plain.numbers, { signs, reference: start[0] });
}
