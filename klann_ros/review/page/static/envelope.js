'use strict';
/* The minimum and the maximum of values at each crank angle, over all turns. */

const MAX_BINS = 720;

/** Return bins of the crank angle [deg], and the minimum and the maximum of each column. */
function envelope(angles, columns) {
  // Some poses to a bin, so that few of them are empty.
  const bins = Math.min(MAX_BINS, Math.max(36, Math.floor(angles.length / 4)));
  const places = Array.from(angles, (angle) => {
    const part = angle / TURN;
    return Number.isFinite(part) ? Math.floor((part - Math.floor(part)) * bins) % bins : -1;
  });
  const degrees = Array.from({ length: bins }, (_, bin) => ((bin + 0.5) * 360) / bins);
  return [degrees, ...columns.flatMap((column) => extremes(column, places, bins))];
}

function extremes(column, places, bins) {
  const least = new Array(bins).fill(null);
  const greatest = new Array(bins).fill(null);
  places.forEach((bin, row) => {
    const value = column[row];
    if (bin < 0 || !Number.isFinite(value)) return;
    if (least[bin] === null || value < least[bin]) least[bin] = value;
    if (greatest[bin] === null || value > greatest[bin]) greatest[bin] = value;
  });
  return [least, greatest];
}
