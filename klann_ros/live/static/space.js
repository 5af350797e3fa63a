'use strict';
/* From a leg's plane to base_link, and from there to the views from the side and from above. */

const TURN = 2 * Math.PI;
// What the page shows for what is sent: the unit, and its number of one in SI units.
const PAGE_UNITS = {
  m: ['mm', 1000],
  rad: ['°', 360 / TURN],
  'm/s': ['mm/s', 1000],
  'rad/s': ['°/s', 360 / TURN],
};
const SI_QUANTITY = /(-?\d+(?:\.\d+)?(?:e[-+]?\d+)?) (rad|m)(\/s)?(?![\w/²^])(?: \([+]?([-\d.]+) deg\))?/g;

/** Return a number in SI units as the page shows it, without the last digits of the conversion. */
function inPageUnit(value, unit) {
  return Number((value * PAGE_UNITS[unit][1]).toPrecision(12));
}

/** Return a number that the page shows in SI units; a decimal fraction of mm is exactly that of m. */
function inSiUnit(value, unit) {
  const [, factor] = PAGE_UNITS[unit];
  return unit === 'm' ? Number((value / factor).toPrecision(15)) : value / factor;
}

function quantityText(value, unit) {
  const [name] = PAGE_UNITS[unit];
  return `${value}${name.startsWith('°') ? '' : ' '}${name}`;
}

/** Return a message of a node of ours with its lengths and angles in the page's units. */
function inPageUnits(text) {
  return text.replace(SI_QUANTITY, (_, number, base, perSecond = '', angle = '') => {
    if (angle) return quantityText(Number(angle), base);
    const unit = base + perSecond;
    return quantityText(Number((number * PAGE_UNITS[unit][1]).toPrecision(6)), unit);
  });
}

/** Return the axes of a plane in base_link, by its roll, pitch and yaw about fixed axes. */
function axesOf([roll, pitch, yaw]) {
  const [a, b, c] = [roll, pitch, yaw].map(Math.cos);
  const [d, e, f] = [roll, pitch, yaw].map(Math.sin);
  return [
    [c * b, f * b, -e],
    [c * e * d - f * a, f * e * d + c * a, b * d],
  ];
}

/** Return points (x, y) of a mounted plane in base_link: (x, y, z). */
function mounted(points, mount) {
  const [u, v] = axesOf(mount.rpy);
  return points.map(([x, y]) => [0, 1, 2].map((i) => mount.xyz[i] + x * u[i] + y * v[i]));
}

const VIEWS = {
  side: ([x, , z]) => [x, z],
  above: ([x, y]) => [x, y],
};

/** Return an angle within half a turn. */
function wrapped(angle) {
  return angle - TURN * Math.round(angle / TURN);
}

function degrees(angle) {
  return (angle * 360) / TURN;
}
