'use strict';
/* What a pose does when the crank turns: derivatives by its angle, as Leg.velocity, Leg.acceleration. */

/**
 * Return {x1, x2, points1, points2}: the first and second derivatives of the coordinates [1, m/rad]
 * and of the points [m/rad] by the crank angle; NaN at a singular pose.
 */
function motionOf(linkage, { u, x }) {
  const { structure, changes, blocks } = linkage;
  const alpha = x[0];
  const still = u.map(() => [0, 0]);
  let x1 = changes.through(alpha, 1);
  let x2 = null;
  if (x1) {
    x2 = changes.through(alpha, 2).with(0, 0);
    x1 = x1.with(0, 1);
  } else {
    const isSingular = blocks.some((block) => !(Math.abs(block.sine(u)) > block.singularSine));
    x1 = isSingular ? x.map(() => NaN) : solvedRates(linkage, u, 1, still);
  }
  const bent = bentVectors(structure, u, x1);
  x2 ||= solvedRates(linkage, u, 0, bent);
  const moved = (row, rates, vectors) =>
    rates.reduce(
      (sum, rate, i) => C.add(sum, C.times(rate, columnOf(structure, row.terms, u, i))),
      vectorSum({ terms: row.terms, constant: [0, 0] }, vectors),
    );
  const points1 = linkage.pointRows.map((row) => moved(row, x1, still));
  const points2 = linkage.pointRows.map((row) => moved(row, x2, bent));
  return { x1, x2, points1, points2 };
}

/** Return the part of d2u_j that is quadratic in the rates of the coordinates: see joints.py. */
function bentVectors(structure, u, rates) {
  return structure.bodies.map(({ slides }, j) => {
    const frame = structure.frames[j];
    if (frame === FIXED) return [0, 0];
    const turned = C.times(-(rates[frame] ** 2), u[j]);
    const slid = [0, 2 * structure.senses[frame] * rates[j] * rates[frame]];
    return slides ? C.add(turned, C.mul(slid, u[frame])) : turned;
  });
}

/** Return the rates of all coordinates that keep the loops closed, block by block. */
function solvedRates(linkage, u, crank, bent) {
  const { structure, blocks } = linkage;
  const rates = u.map(() => 0);
  rates[0] = crank;
  for (const { rows, unknowns } of blocks) {
    const openings = rows.flatMap(({ terms }) =>
      rates.reduce(
        (sum, rate, i) => {
          const column = columnOf(structure, terms, u, i);
          return column[0] || column[1] ? C.add(sum, C.times(rate, column)) : sum;
        },
        vectorSum({ terms, constant: [0, 0] }, bent),
      ),
    );
    const { x } = solved(jacobianOf(structure, rows, u, unknowns), openings);
    unknowns.forEach((j, n) => {
      rates[j] = x ? -x[n] : NaN;
    });
  }
  return rates;
}

/** Return the mechanical advantages of all bodies, T / T of the crank: see Leg.table. */
function advantagesOf(linkage, { x1 }) {
  const advantages = x1.map((rate) => 1 / rate);
  for (const { unknowns, roundingOfSine } of linkage.blocks)
    for (const j of unknowns) {
      const speed = Math.abs(x1[j]) / (linkage.structure.bodies[j].slides ? linkage.size : 1);
      // Where a body turns back its rate is rounding.
      if (speed <= roundingOfSine) advantages[j] = Infinity;
    }
  return advantages;
}
