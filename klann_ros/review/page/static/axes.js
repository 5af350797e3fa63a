'use strict';
/* The axes of charts, linear ones and those of powers of ten. */

function axis(label, size, isLog = false) {
  const filter = isLog
    ? (u, splits) => splits.map((value) => (isPower(value) ? value : null))
    : undefined;
  const line = { stroke: () => themeColour('grid'), width: 1, ...(isLog && { filter }) };
  return {
    label,
    size,
    labelSize: 20,
    labelFont: FONT,
    font: FONT,
    stroke: () => themeColour('quiet'),
    grid: line,
    ticks: { ...line, size: 4 },
    ...(isLog && { filter, values: (u, splits) => splits.map(power) }),
  };
}

function isPower(value) {
  const exponent = Math.log10(value);
  return Math.abs(exponent - Math.round(exponent)) < 1e-9;
}

function power(value) {
  return value === null ? '' : `1e${Math.round(Math.log10(value))}`;
}

/** Return the powers of ten around values, two of them at least. */
function powers(u, min, max) {
  if (!(min > 0)) return [1e-15, 1e-12];
  const low = Math.floor(Math.log10(min));
  return [10 ** low, 10 ** Math.max(Math.ceil(Math.log10(max)), low + 2)];
}
