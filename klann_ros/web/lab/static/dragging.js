'use strict';
/* What a linkage becomes when one of its points is dragged, and its shape for drawing.js. */

/** Return the shape that drawing.js draws: as page/shape.py has it. */
function shapeOf({ structure, pointRows }) {
  const at = (names) => names.map((name) => structure.points.indexOf(name));
  return {
    senses: structure.senses,
    frames: structure.frames.map((f, j) => (f === j ? null : f)),
    pivots: at(structure.pivots),
    foot: structure.foot,
    points: structure.points.map((name, i) => ({
      name,
      at: pointRows[i].constant,
      terms: [...pointRows[i].terms].map(([j, [re, im]]) => [j, re, im]),
    })),
    bodies: structure.bodies.map((body) => ({
      name: body.name,
      bars: rigidBars(body).map((bar) => at([bar.from, bar.to])),
      line: body.slides ? at([body.bars[0].from, body.bars[0].to]) : null,
    })),
  };
}

// A number of which this part changes has not been dragged.
const UNCHANGED = 1e-9;
const MAX_ANGLE_STEP = 1;

/** Return the largest of 1, 2, 5, 10, ... that is not above a value. */
function roundStep(value) {
  const power = 10 ** Math.floor(Math.log10(value) + 1e-9);
  const factor = value / power;
  return (factor >= 5 - 1e-9 ? 5 : factor >= 2 - 1e-9 ? 2 : 1) * power;
}

/** Return the nearest multiple of a step, without the noise of the product's last digits. */
function rounded(value, step) {
  return Number((Math.round(value / step) * step).toPrecision(12));
}

/** Return an angle rounded to what a step [m] is at a radius [m]. */
function roundedAngle(angle, step, radius) {
  const degrees = (360 / TAU) * (step / radius);
  const own = rounded((360 / TAU) * angle, Math.min(roundStep(degrees), MAX_ANGLE_STEP));
  return own * (TAU / 360);
}

/** Return numbers after a drag; those that it changed are rounded to its step [m]. */
function roundedNumbers({ structure, size, numbers: before }, numbers, step) {
  const lengths = new Map(
    structure.dimensions.flatMap(({ kind, place }, n) =>
      kind === 'length' ? [[place, numbers[n]]] : [],
    ),
  );
  return structure.dimensions.map(({ kind, place }, n) => {
    const value = numbers[n];
    if (Math.abs(value - before[n]) <= UNCHANGED * (kind === 'bend' ? 1 : size)) return before[n];
    if (kind === 'bend') return roundedAngle(value, step, lengths.get(place) || size);
    const isLength = kind === 'length' || kind === 'brace';
    return isLength ? Math.max(rounded(value, step), step) : rounded(value, step);
  });
}

/** Return the linkage and crank angle after a point was dragged in steps [m]; null if it cannot be. */
function draggedTo(linkage, pose, crank, i, target, step) {
  const { structure } = linkage;
  const name = structure.points[i];
  const numbers = [...linkage.numbers];
  const place = structure.pivots.indexOf(name);
  if (place >= 0) {
    structure.dimensions.forEach((d, n) => {
      if (d.place === place && d.kind === 'x') [numbers[n]] = target;
      if (d.place === place && d.kind === 'y') [, numbers[n]] = target;
    });
    const rounded = roundedNumbers(linkage, numbers, step);
    return { linkage: linkage.with(rounded, linkage.branchAt(crank)), alpha: crank };
  }
  if (pose.error) return null;
  const points = pose.points.map((point, k) => (k === i ? target : point));
  const { u } = measured(structure, points, pose.u, name, numbers);
  const x = linkage.coordinates(u);
  const turn = wrap(x[0] - crank);
  const isTurned = Math.abs(turn) > UNCHANGED;
  const alpha = isTurned ? roundedAngle(crank + turn, step, C.abs(linkage.bars[0])) : crank;
  const made = assembledNear(linkage, roundedNumbers(linkage, numbers, step), alpha, x, points);
  if (!poseAt(made, alpha).error) return { linkage: made, alpha };
  // Near a limit of the reach rounding may jam what closes as it was dragged.
  return {
    linkage: assembledNear(linkage, numbers, crank + turn, x, points),
    alpha: crank + turn,
  };
}

/** Return a linkage with other numbers, in the assembly that lies nearest to points. */
function assembledNear(linkage, numbers, alpha, x, points) {
  const { structure, kept, isDyadic } = linkage;
  const branch = isDyadic ? linkage.branchAt(alpha) : { start: [alpha, ...x.slice(1)] };
  const made = new Linkage(structure, numbers, { ...kept, ...branch });
  if (!made.isDyadic) return made;
  // A joint may pass from one assembly into another.
  const off = (one) => Math.hypot(...one.points.flatMap((point, k) => C.sub(point, points[k])));
  const own = poseAt(made, alpha);
  const poses = own.error ? dyadPoses(made, alpha, 64) : [own, ...dyadPoses(made, alpha, 64)];
  if (!poses.length) return made;
  const best = poses.reduce((a, b) => (off(b) < off(a) - 1e-9 * made.size ? b : a));
  const isBetter = String(best.signs) !== String(made.signs);
  return isBetter ? made.with(numbers, made.branchAt(alpha, best.signs)) : made;
}

/** Measure the bars of all bodies that have a point, into `numbers`; return how the bodies lie. */
function measured(structure, points, before, name, numbers) {
  const at = (point) => points[structure.points.indexOf(point)];
  const u = [...before];
  const write = (kind, place, value) => {
    const n = structure.dimensions.findIndex((d) => d.kind === kind && d.place === place);
    if (n < 0) return;
    // A bend stays near what it was: 350 deg do not become -10.
    numbers[n] = kind === 'bend' ? nearBend(numbers[n], value) : value;
  };
  structure.bodies.forEach((body, j) => {
    if (!rigidBars(body).some((bar) => bar.from === name || bar.to === name)) return;
    const first = structure.firsts[j];
    if (!body.slides) {
      const [bar] = body.bars;
      const along = C.sub(at(bar.to), at(bar.from));
      const length = C.abs(along);
      refuseUnless(
        length > 0,
        `${bar.from}-${bar.to}: a length must be > 0`,
        `${bar.from}-${bar.to}: um comprimento tem de ser > 0`,
      );
      u[j] = C.times(1 / length, along);
    }
    const frame = rotationOf(structure, u, j);
    body.bars.forEach((bar, k) => {
      if (body.slides && !k) return;
      const vector = C.sub(at(bar.to), at(bar.from));
      write('length', first + k, C.abs(vector));
      if (!bar.brace) {
        write('bend', first + k, C.arg(C.div(vector, frame)));
        return;
      }
      const base = C.sub(at(bar.brace.from), at(bar.from));
      const isLeft = C.cross(base, vector) > 0;
      refuseUnless(isLeft === (bar.brace.side === 'left'), TEXTS.en.side, TEXTS.pt.side);
      write('brace', first + k, C.abs(C.sub(at(bar.to), at(bar.brace.from))));
    });
  });
  return { u };
}

function nearBend(before, value) {
  const near = before + wrap(value - before);
  return Math.abs(near) <= TAU ? near : wrap(value);
}
