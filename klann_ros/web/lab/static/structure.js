'use strict';
/*
 * What a linkage is made of, without a number: as klann_ros.kinematics.linkage.structure has it.
 *
 * A body is {name, clockwise, along, bars: [{from, to, brace: {from, side} | null}]}; `along` is the
 * body that it slides along, 'ground', or '' for one that turns. Of one that slides the first bar is
 * the line. The crank is the first body.
 */

const FIXED = -1;
const GROUND = 'ground';

class Structure {
  constructor(pivots, bodies, foot) {
    this.pivots = pivots;
    this.bodies = bodies.map((body) => ({ ...body, slides: body.along !== '' }));
    this.foot = foot;
    for (const body of this.bodies) body.points = ownPoints(body);
    this.bodies.forEach(checkBody);
    this.angles = this.bodies.map((body) => body.name);
    checkSlides(this);
    this.points = [...new Set([...pivots, ...this.bodies.flatMap((body) => body.points)])];
    checkEnds(this);
    this.senses = this.bodies.map((body) => (body.clockwise ? -1 : 1));
    this.slides = this.bodies.some((body) => body.slides);
    this.along = this.bodies.map((body) => this.numberOf(body.along));
    this.frames = this.bodies.map((_, j) => this.frame(j));
    this.bars = this.bodies.flatMap((body, j) => body.bars.map((bar) => ({ body: j, bar })));
    this.firsts = this.bodies.map((_, j) => this.bars.findIndex(({ body }) => body === j));
    this.isLine = this.bars.map(
      ({ body }, n) => this.bodies[body].slides && this.firsts[body] === n,
    );
    this.isStraight = this.bars.map(
      ({ body }, n) => !this.bodies[body].slides && this.firsts[body] === n,
    );
    this.carriers = this.bars.map(({ body }, n) => (this.isLine[n] ? body : this.frames[body]));
    this.dimensions = dimensionsOf(this);
    this.groups = assemblyOrder(this);
    this.paths = loopPaths(this);
    this.isDyadic = this.paths.rows.every((rows) => rows.length === 1);
  }

  numberOf(along) {
    if (along === '') return null;
    return along === GROUND ? FIXED : this.angles.indexOf(along);
  }

  /** Return with which body one turns: itself, the one that it slides along, or FIXED. */
  frame(j) {
    const along = j >= 0 ? this.along[j] : null;
    return along === null ? j : this.frame(along);
  }

  /** Return the part that the first so many blocks place, and which of its bodies these are. */
  head(count) {
    const placed = [0, ...this.groups.slice(0, count).flat()].sort((a, b) => a - b);
    const bodies = placed.map((j) => this.bodies[j]);
    return [new Structure(this.pivots, bodies, bodies[0].points.at(-1)), placed];
  }
}

/** Return the bars of a body that have a length of their own. */
function rigidBars(body) {
  return body.along ? body.bars.slice(1) : body.bars;
}

function ownPoints(body) {
  refuseUnless(
    body.bars.length,
    `body ${body.name} has no bars`,
    `o corpo ${body.name} não tem barras`,
  );
  return [...(body.along ? [] : [body.bars[0].from]), ...body.bars.map((bar) => bar.to)];
}

function checkBody(body) {
  const [line] = body.bars;
  const points = [body.along ? line.to : line.from];
  refuseUnless(
    !body.along || line.from !== line.to,
    `the line ${line.from}-${line.to} of body ${body.name} has only one point`,
    `a reta ${line.from}-${line.to} do corpo ${body.name} tem um só ponto`,
  );
  for (const bar of rigidBars(body)) {
    const [en, pt] = [
      `bar ${bar.from}-${bar.to} of body ${body.name}`,
      `a barra ${bar.from}-${bar.to} do corpo ${body.name}`,
    ];
    refuseUnless(
      points.includes(bar.from),
      `${en} starts from a point that the body does not have yet: it has ${points.join(', ')}`,
      `${pt} começa num ponto que o corpo ainda não tem: ele tem ${points.join(', ')}`,
    );
    refuseUnless(
      !points.includes(bar.to),
      `${en} ends at a point that the body has already`,
      `${pt} termina num ponto que o corpo já tem`,
    );
    refuseUnless(
      !bar.brace || points.includes(bar.brace.from),
      `${en} is braced from ${bar.brace && bar.brace.from}, which is no point of it yet`,
      `${pt} é escorada a partir de ${bar.brace && bar.brace.from}, que ainda não é ponto dele`,
    );
    points.push(bar.to);
  }
}

function checkSlides({ bodies, pivots, angles }) {
  refuseUnless(
    !angles.includes(GROUND),
    `a body cannot be called ${GROUND}`,
    `um corpo não pode chamar-se ${GROUND}`,
  );
  for (const body of bodies.filter(({ slides }) => slides)) {
    const en = `${body.name} slides along ${body.along}`;
    const pt = `${body.name} desliza ao longo de ${body.along}`;
    const carrier = bodies[angles.indexOf(body.along)];
    refuseUnless(
      carrier || body.along === GROUND,
      `${en}, which is no body`,
      `${pt}, que não é um corpo`,
    );
    const points = carrier ? carrier.points : pivots;
    const start = body.bars[0].from;
    refuseUnless(
      points.includes(start),
      `${en} from ${start}, which is none of its points: ${points.join(', ')}`,
      `${pt} a partir de ${start}, que não é um dos seus pontos: ${points.join(', ')}`,
    );
    const seen = new Set([body.name]);
    for (let next = carrier; next && next.slides; next = bodies[angles.indexOf(next.along)]) {
      refuseUnless(
        !seen.has(next.name),
        `${en}, which slides along it in turn`,
        `${pt}, que por sua vez desliza nele`,
      );
      seen.add(next.name);
    }
  }
}

function checkEnds({ bodies, pivots, points, foot }) {
  const [crank] = bodies;
  const [start] = crank.points;
  const fixed = pivots.join(', ');
  refuseUnless(
    !crank.slides,
    `the crank ${crank.name} slides: a driven link must turn`,
    `a manivela ${crank.name} desliza: o que é acionado tem de girar`,
  );
  refuseUnless(
    pivots.includes(start),
    `the crank starts from ${start}, which is no pivot: these are ${fixed}`,
    `a manivela começa em ${start}, que não é uma articulação fixa: elas são ${fixed}`,
  );
  refuseUnless(
    !pivots.includes(foot),
    `the foot ${foot} is a pivot and does not move`,
    `o pé ${foot} é uma articulação fixa e não se move`,
  );
  refuseUnless(
    points.includes(foot),
    `the foot ${foot} is none of the points: ${points.join(', ')}`,
    `o pé ${foot} não é um dos pontos: ${points.join(', ')}`,
  );
}

/** Return all numbers of a structure, named by points, and by bodies where names coincide. */
function dimensionsOf(structure) {
  const dimensions = [];
  const add = (name, kind, place) => dimensions.push({ name, kind, place });
  structure.bars.forEach(({ bar }, place) => {
    const ends = `${bar.from}-${bar.to}`;
    if (structure.isLine[place]) {
      add(`direction of ${ends}`, 'bend', place);
      return;
    }
    add(ends, 'length', place);
    if (bar.brace) add(`${bar.brace.from}-${bar.to}`, 'brace', place);
    else if (!structure.isStraight[place]) add(`bend of ${ends}`, 'bend', place);
  });
  const names = dimensions.map(({ name }) => name);
  dimensions.forEach((dimension, n) => {
    if (names.indexOf(names[n]) !== names.lastIndexOf(names[n]))
      dimension.name += ` of ${structure.angles[structure.bars[dimension.place].body]}`;
  });
  structure.pivots.forEach((name, place) => {
    for (const axis of 'xy') add(`${name}.${axis}`, axis, place);
  });
  return dimensions;
}

/** Return the bodies that have a point. */
function bodiesAt({ bodies }, point) {
  return bodies.filter(({ points }) => points.includes(point));
}

/** Return whether a body turns about a pivot or slides along the ground. */
function isGuided({ pivots }, { points, along }) {
  return along === GROUND || points.some((point) => pivots.includes(point));
}

/** Return whether the foot is one: of a file that does not say so, if it is not on a guided body. */
function isLeg(structure, { leg }) {
  if (leg !== undefined) return leg;
  return !bodiesAt(structure, structure.foot).some((body) => isGuided(structure, body));
}
