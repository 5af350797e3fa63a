'use strict';
/* A leg in a run: its recorded poses, and where its points are at each of them. */

const TURN = 2 * Math.PI;

class Leg {
  constructor(data) {
    const rows = data.rows;
    this.title = data.title;
    this.joints = data.joints;
    this.slides = data.slides;
    this.shape = data.shape;
    this.texts = data.texts;
    this.since = data.since;
    this.of = rows.of;
    this.times = unpacked(rows.times);
    this.foot = rows.foot.map(unpacked);
    this.angles = (rows.angles || []).map(unpacked);
    this.turns = rows.turns ? unpacked(rows.turns) : new Float64Array(this.times.length);
    this.rates = (rows.rates || []).map(unpacked);
    this.residuals = rows.residuals ? unpacked(rows.residuals) : new Float32Array(0);
    this.transmission = (rows.transmission || []).map(unpacked);
    this.gaps = rows.gaps.map((row) => [this.times[row], this.times[row + 1]]);
    this.iterations = {
      times: unpacked(data.iterations.times),
      most: unpacked(data.iterations.most),
    };
    this.path = this.shape && this.shape.path ? this.shape.path.map(unpacked) : null;
    this.byCrank = null;
  }

  get count() {
    return this.times.length;
  }

  get hasPoses() {
    return this.angles.length > 0;
  }

  /** Return the row whose time is nearest. */
  nearest(time) {
    return nearestIn(this.times, time);
  }

  /** Return the row whose crank angle is nearest, modulo a turn. */
  nearestAtCrank(angle) {
    if (!this.byCrank) this.byCrank = sortedByCrank(this.angles[0]);
    const { rows, angles } = this.byCrank;
    const wanted = angle - TURN * Math.round(angle / TURN);
    return rows.length ? rows[nearestIn(angles, wanted)] : -1;
  }

  /** Return the crank angle as it was recorded, with all its turns [rad]. */
  crankAngle(row) {
    return this.hasPoses ? this.angles[0][row] + TURN * this.turns[row] : NaN;
  }

  /** Return the recorded foot (x, y) [m]; null where there is none. */
  footAt(row) {
    const at = [this.foot[0][row], this.foot[1][row]];
    return at.every(Number.isFinite) ? at : null;
  }

  /** Return the reason why the leg is not drawn at a row; '' where it is. */
  hiddenBecause(row) {
    if (!this.shape) return 'the run contains no geometry';
    if (!this.hasPoses) return 'the run contains no pose';
    // Times are known to a microsecond.
    if (this.times[row] < this.since - 2e-6)
      return `before ${this.since.toFixed(3)} s it had other dimensions`;
    return this.angles.every((angle) => Number.isFinite(angle[row]))
      ? ''
      : 'an angle of this pose is not a number';
  }

  /** Return the points (x, y) at a recorded pose [m]; null where the leg cannot be drawn. */
  points(row) {
    if (row < 0 || row >= this.count || this.hiddenBecause(row)) return null;
    return pointsOf(
      this.shape,
      this.angles.map((angle) => angle[row]),
    );
  }
}

/** Return the index of the nearest of sorted numbers; -1 for none. */
function nearestIn(numbers, wanted) {
  let low = 0;
  let high = numbers.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (numbers[middle] <= wanted) low = middle;
    else high = middle;
  }
  return high > low && wanted - numbers[low] > numbers[high] - wanted ? high : low;
}

function sortedByCrank(angles) {
  const rows = [];
  angles.forEach((angle, row) => {
    if (Number.isFinite(angle)) rows.push(row);
  });
  rows.sort((a, b) => angles[a] - angles[b]);
  return { rows, angles: Float64Array.from(rows, (row) => angles[row]) };
}

/** Return angles [deg] without the jump at half a turn, as far as they stay near their mean. */
function aroundTheirMean(angles) {
  let x = 0;
  let y = 0;
  for (const angle of angles) {
    if (Number.isFinite(angle)) {
      x += Math.cos(angle);
      y += Math.sin(angle);
    }
  }
  const mean = Math.atan2(y, x);
  return Float64Array.from(angles, (angle) => {
    const off = angle - mean;
    return ((mean + off - TURN * Math.round(off / TURN)) * 360) / TURN;
  });
}

/** Return a position [m] as text in millimetres. */
function positionText(position) {
  return `${position.map((metres) => fixedText(1000 * metres, 1)).join(', ')} mm`;
}
