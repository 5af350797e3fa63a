'use strict';
/* The branch of coupled loops: what a linkage reaches from its start when the crank is turned. */

// A guess of coupled loops that needs more correction may have left its branch [rad].
const MAX_BRANCH_JUMP = 0.05;
// Between the poses of a branch, and where steps smaller than this fail it ends [rad].
const BRANCH_STEP = 0.05;
const MIN_BRANCH_STEP = 1e-9;
const BRANCH_TOLERANCE = 1e-9;
const BRANCH_ITERATIONS = 6;
// The longest way to a change point that is stepped across, and the steps beside it [rad]. The
// rates on its two sides are the same within a part of them.
const MAX_CROSSING = 0.02;
const CROSSING_STEP = 2.5e-3;
const SAME_RATE = 0.02;

/** Return the pose {x, rates, sines} that a guess leads to on the branch of some signs, or null. */
function corrected(linkage, start, signs) {
  const { bodies } = linkage.structure;
  let x = start;
  let isSettled = false;
  let now = null;
  for (let k = 0; ; k += 1) {
    if (k === BRANCH_ITERATIONS) return null;
    now = linkage.equations(x);
    const isClosed = linkage.blocks.every((block, b) =>
      linkage.structure.paths.rows[b].every(
        (row) =>
          Math.max(Math.abs(now.f[2 * row]), Math.abs(now.f[2 * row + 1])) <= block.rounding,
      ),
    );
    if (isSettled || isClosed) break;
    const { x: correction } = solved(now.phi, now.f);
    if (!correction) return null;
    x = x.map((value, j) => (j ? value - correction[j - 1] : value));
    isSettled = correction.every(
      (e, j) => Math.abs(e) <= BRANCH_TOLERANCE * (bodies[j + 1].slides ? linkage.size : 1),
    );
  }
  const sines = linkage.blocks.map((block) => block.sine(now.u));
  const isOn =
    !signs ||
    linkage.blocks.every(
      (block, b) => !block.twoBranches || sines[b] * signs[b] >= -block.roundingOfSine,
    );
  const isNear = x.every(
    (value, j) =>
      Math.abs(value - start[j]) <= MAX_BRANCH_JUMP * (bodies[j].slides ? linkage.size : 1),
  );
  if (!isOn || !isNear) return null;
  const isSingular = linkage.blocks.some(
    (block, b) => Math.abs(sines[b]) <= block.singularSine,
  );
  const crank = linkage.rows.flatMap(({ terms }) => columnOf(linkage.structure, terms, now.u, 0));
  const { x: rates } = isSingular ? { x: null } : solved(now.phi, crank);
  return { x: linkage.wrapped(x), rates: rates && rates.map((rate) => -rate), sines };
}

/** The poses of coupled loops along their branch, over whole turns or an arc: see branch.py. */
class Branch {
  constructor(linkage, block) {
    Object.assign(this, { linkage, block, period: 1, changes: [] });
    const first = this.row(linkage.start, linkage.signs);
    refuseUnless(
      first,
      'its coupled loops cannot be followed from the start: it is nearly singular there',
      'as suas malhas acopladas não podem ser seguidas a partir do start: ele é quase singular',
    );
    let rows = this.follow([first], 1);
    while (!this.isClosed(rows) && this.changes.length && this.period < MAX_PERIOD) {
      if (rows.at(-1).x[0] - first.x[0] < this.period * TAU) break;
      this.period += 1;
      rows = this.follow(rows, 1);
    }
    if (!this.isClosed(rows)) {
      this.period = 1;
      const back = this.follow([first], -1).slice(1).reverse();
      rows = [...back, ...rows];
    }
    this.rows = rows;
    this.first = rows[0].x[0];
    this.last = rows.at(-1).x[0];
    this.isTurn = this.isClosed(rows);
    this.changes = this.changes.filter(({ alpha }) => this.first <= alpha && alpha <= this.last);
    refuseUnless(
      this.isTurn || this.last - this.first < TAU,
      'its coupled loops are not back where they were after a turn of the crank: one crank angle has two poses, and such a linkage is not solved',
      'as suas malhas acopladas não voltam ao mesmo lugar após uma volta da manivela: um ângulo tem duas posições, e tal mecanismo não é resolvido',
    );
  }

  get arc() {
    return this.isTurn ? [0, TAU] : [this.first, this.last];
  }

  x(alpha) {
    const middle = (this.first + this.last) / 2;
    const length = this.period * TAU;
    const at = alpha - length * Math.round((alpha - middle) / length);
    const nearest = this.rows.reduce((best, row) =>
      Math.abs(row.x[0] - at) < Math.abs(best.x[0] - at) ? row : best,
    );
    if (this.first <= at && at <= this.last) {
      const guess = predict(nearest, at - nearest.x[0]);
      guess[0] = alpha;
      const pose = corrected(this.linkage, guess, nearest.signs);
      if (pose) return pose.x;
    }
    throw new LoopsOpen(this.block, alpha + nearest.x[0] - at);
  }

  /** Return the pose that a guess leads to, with its signs; null if it is singular or on none. */
  row(guess, signs) {
    const pose = corrected(this.linkage, guess, signs);
    if (!pose?.rates) return null;
    return { ...pose, signs: signs || pose.sines.map((sine) => (sine < 0 ? -1 : 1)) };
  }

  follow(before, direction) {
    const rows = [...before];
    const length = this.period * TAU;
    let step = BRANCH_STEP;
    while (Math.abs(rows.at(-1).x[0] - rows[0].x[0]) < length && step > MIN_BRANCH_STEP) {
      const last = rows.at(-1);
      const row = this.row(predict(last, direction * step), last.signs);
      const beyond = row ? [] : this.stepAcross(rows);
      rows.push(...(row ? [row] : beyond));
      if (beyond.length) step = CROSSING_STEP;
      else step = row ? Math.min(BRANCH_STEP, 2 * step) : step / 2;
    }
    return rows;
  }

  /** Return the poses beyond a change point that follows; none where the branch ends. */
  stepAcross(rows) {
    if (rows.length < 2 || this.linkage.atChangePoints === SIGN) return [];
    const [before, last] = rows.slice(-2);
    const step = last.x[0] - before.x[0];
    // A determinant falls linearly to a change point, and as a root to where the branch ends.
    const distances = last.sines.map((sine, b) => (sine * step) / (before.sines[b] - sine));
    const distance = Math.min(...distances.map((d) => (d * step > 0 ? Math.abs(d) : Infinity)));
    if (!(distance < MAX_CROSSING)) return [];
    const ahead = (alpha, rate) => hermite(before, last, alpha, rate);
    const far = this.row(ahead(last.x[0] + 2 * Math.sign(step) * distance), null);
    if (!far || String(far.signs) === String(last.signs)) return [];
    const slopes = ahead(far.x[0], true);
    const isSmooth = far.rates.every(
      (rate, i) => Math.abs(rate - slopes[i + 1]) <= SAME_RATE * (1 + Math.abs(rate)),
    );
    if (!isSmooth) return [];
    let centre = this.crossing(last, far);
    const sides = [last, far];
    for (const n of [-2, -1, 1, 2]) {
      const alpha = centre + n * Math.sign(step) * CROSSING_STEP;
      const side = n < 0 ? last : far;
      if ((alpha - last.x[0]) * (far.x[0] - alpha) <= 0) continue;
      const row = this.row(hermite(last, far, alpha), side.signs);
      if (row) sides.splice(-1, 0, row);
    }
    const k = sides.findIndex((row) => String(row.signs) !== String(last.signs));
    centre = this.crossing(sides[k - 1], sides[k]);
    const b = far.signs.findIndex((sign, i) => sign !== last.signs[i]);
    this.changes.push({ alpha: centre, block: b + 1, flips: true });
    return sides.slice(1);
  }

  /** Return where a determinant passes 0 between two poses. */
  crossing(from, to) {
    const b = to.signs.findIndex((sign, i) => sign !== from.signs[i]);
    let [low, high] = [from.x[0], to.x[0]];
    for (let n = 0; n < 60; n += 1) {
      const middle = (low + high) / 2;
      const u = this.linkage.vectors(hermite(from, to, middle));
      if (this.linkage.blocks[b].sine(u) * from.signs[b] > 0) low = middle;
      else high = middle;
    }
    return (low + high) / 2;
  }

  isClosed(rows) {
    const [start, end] = [rows[0], rows.at(-1)];
    const length = this.period * TAU;
    if (end.x[0] - start.x[0] < length || String(start.signs) !== String(end.signs)) return false;
    const back = predict(end, start.x[0] + length - end.x[0]);
    return poseDistance(this.linkage, back, start.x) <= MAX_BRANCH_JUMP;
  }
}

function predict({ x, rates }, step) {
  return x.map((value, j) => value + step * (j ? rates[j - 1] : 1));
}

/** Return the coordinates, or their rates, of the cubic through two poses and their rates. */
function hermite(from, to, alpha, isRate = false) {
  const length = to.x[0] - from.x[0];
  const t = (alpha - from.x[0]) / length;
  return from.x.map((start, j) => {
    if (!j) return isRate ? 1 : alpha;
    const [p, q] = [length * from.rates[j - 1], length * to.rates[j - 1]];
    // The end, as it lies near what the rates lead to.
    const guess = start + (p + q) / 2;
    const rise = (Math.abs(to.x[j] - guess) > Math.PI ? guess + wrap(to.x[j] - guess) : to.x[j]) - start;
    const [b, a] = [3 * rise - 2 * p - q, p + q - 2 * rise];
    return isRate ? (p + t * (2 * b + 3 * t * a)) / length : start + t * (p + t * (b + t * a));
  });
}
