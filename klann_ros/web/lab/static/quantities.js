'use strict';
/* All that a linkage has at a crank angle, as columns with the names and units of Leg.table. */

// Each kind of quantity: its unit, that of the page, its size in SI, and decimals.
const KINDS = {
  angle: ['deg', '°', 360 / TAU, 2],
  length: ['mm', 'mm', 1000, 2],
  angle_rate: ['rad/s', 'rad/s', 1, 4],
  length_rate: ['mm/s', 'mm/s', 1000, 2],
  angle_acceleration: ['rad/s^2', 'rad/s²', 1, 4],
  length_acceleration: ['mm/s^2', 'mm/s²', 1000, 2],
  angle_advantage: ['1', '1', 1, 4],
  length_advantage: ['1/m', '1/m', 1, 4],
};
// The derivatives of a quantity, as the ends of their names and as marks.
const ORDERS = ['', '_rate', '_acceleration'];

/**
 * Return the quantities of a linkage: {key, name, kind, of(state)}; `of` is in SI units.
 *
 * A state is {pose, motion, advantages, rate}, with the crank's rate [rad/s]; `name` is the body's,
 * the point's with its axis, or the dyad's number and links.
 */
function quantitiesOf(linkage) {
  const { structure, blocks } = linkage;
  const { bodies, points, pivots } = structure;
  const kindOf = (j) => (bodies[j].slides ? 'length' : 'angle');
  const quantities = [];
  const add = (key, about, kind, of) => quantities.push({ key, kind, of, ...about });
  const body = (j) => ({ body: j, name: bodies[j].name });
  add(bodies[0].name, body(0), 'angle', ({ pose }) => pose.x[0]);
  ORDERS.forEach((end, order) => {
    for (let j = 1; j < bodies.length; j += 1) {
      const of = ({ pose, motion, rate }) =>
        order ? rate ** order * motion[`x${order}`][j] : pose.x[j];
      add(bodies[j].name + end, { ...body(j), order }, kindOf(j) + end, of);
    }
    points.forEach((point, i) => {
      if (pivots.includes(point)) return;
      for (const axis of [0, 1]) {
        const name = `${point}.${'xy'[axis]}`;
        const of = ({ pose, motion, rate }) =>
          order ? rate ** order * motion[`points${order}`][i][axis] : pose.points[i][axis];
        add(name + end, { point, axis, name, order }, `length${end}`, of);
      }
    });
  });
  blocks.forEach((block, k) => {
    const links = block.isDyad ? block.names.slice(2).filter(Boolean).join(', ') : '';
    add(`mu_${k + 1}`, { dyad: k + 1, name: links }, 'angle', ({ pose }) =>
      block.transmissionAngle(pose.u),
    );
  });
  for (let j = 1; j < bodies.length; j += 1)
    add(
      `${bodies[j].name}_advantage`,
      { ...body(j), order: 3 },
      `${kindOf(j)}_advantage`,
      ({ advantages }) => advantages[j],
    );
  return quantities;
}

/** Return the state at a pose for a crank rate [rad/s]; null where the linkage does not close. */
function stateOf(linkage, pose, rate) {
  if (pose.error) return null;
  // Many curves need no derivatives.
  return {
    pose,
    rate,
    get motion() {
      this.moved ??= motionOf(linkage, pose);
      return this.moved;
    },
    get advantages() {
      return advantagesOf(linkage, this.motion);
    },
  };
}

/** Return the crank angles of a turn, or of all turns that the linkage takes, in such steps [deg]. */
function turnAngles(linkage, step) {
  const count = Math.floor((360 * linkage.changes.period) / step + 1e-9);
  return Array.from({ length: count + 1 }, (_, k) => (k * step * TAU) / 360);
}

/** Return a turn as rows of numbers in the page's units; NaN where there is none. */
function turnRows(linkage, quantities, step, rate) {
  return turnAngles(linkage, step).map((alpha) => {
    const state = stateOf(linkage, poseAt(linkage, alpha), rate);
    return quantities.map(({ kind, of }, n) => {
      // Whole degrees are whole.
      if (!n) return Number((KINDS[kind][2] * alpha).toPrecision(12));
      return state ? KINDS[kind][2] * of(state) : NaN;
    });
  });
}

/** Return rows as CSV: with decimal commas and semicolons where numbers are written so. */
function csvOf(quantities, rows, hasComma, separator = hasComma ? ';' : ',') {
  const cell = (value) => {
    if (Number.isNaN(value)) return '';
    const text = Number.isFinite(value) ? String(value) : value < 0 ? '-inf' : 'inf';
    return hasComma ? text.replace('.', ',') : text;
  };
  const heads = quantities.map(({ key, kind }) => `${key} [${KINDS[kind][0]}]`);
  const lines = [heads, ...rows.map((row) => row.map(cell))];
  return lines.map((line) => `${line.join(separator)}\n`).join('');
}
