'use strict';
/* The branch of coupled loops: what a linkage reaches from its start when the crank is turned. */

// A guess of coupled loops that needs more correction may have left its branch [rad].
const MAX_BRANCH_JUMP = 0.05;
// Between the poses of a branch, and where steps smaller than this fail it ends [rad].
const BRANCH_STEP = 0.05;
const MIN_BRANCH_STEP = 1e-9;
const BRANCH_TOLERANCE = 1e-9;
const BRANCH_ITERATIONS = 6;

/** Return the pose {x, rates} that a guess leads to without leaving its branch, or null. */
function corrected(linkage, start) {
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
  const sines = linkage.blocks.map((block, b) => block.sine(now.u) * linkage.signs[b]);
  const isOn = linkage.blocks.every(
    (block, b) => !block.twoBranches || sines[b] >= -block.roundingOfSine,
  );
  const isNear = x.every(
    (value, j) =>
      Math.abs(value - start[j]) <= MAX_BRANCH_JUMP * (bodies[j].slides ? linkage.size : 1),
  );
  if (!isOn || !isNear) return null;
  const isSingular = linkage.blocks.some((block, b) => sines[b] <= block.singularSine);
  const crank = linkage.rows.flatMap(({ terms }) => columnOf(linkage.structure, terms, now.u, 0));
  const { x: rates } = isSingular ? { x: null } : solved(now.phi, crank);
  return { x: linkage.wrapped(x), rates: rates && rates.map((rate) => -rate) };
}

/** The poses of coupled loops along their branch, over a whole turn or an arc: see branch.py. */
class Branch {
  constructor(linkage, block) {
    this.linkage = linkage;
    this.block = block;
    const first = this.row(linkage.start);
    refuseUnless(
      first,
      'its coupled loops cannot be followed from the start: it is nearly singular there',
      'as suas malhas acopladas não podem ser seguidas a partir do start: ele é quase singular',
    );
    let rows = this.follow(first, 1);
    if (!this.isClosed(rows)) {
      const back = this.follow(first, -1).slice(1).reverse();
      rows = oneTurn([...back, ...rows], linkage.start[0]);
    }
    this.rows = rows;
    this.first = rows[0].x[0];
    this.last = rows.at(-1).x[0];
    this.isTurn = this.isClosed(rows);
    this.checkSeam();
  }

  get arc() {
    return this.isTurn ? [0, TAU] : [this.first, this.last];
  }

  x(alpha) {
    const middle = (this.first + this.last) / 2;
    const at = alpha - TAU * Math.round((alpha - middle) / TAU);
    const nearest = this.rows.reduce((best, row) =>
      Math.abs(row.x[0] - at) < Math.abs(best.x[0] - at) ? row : best,
    );
    if (this.first <= at && at <= this.last) {
      const guess = predict(nearest, at - nearest.x[0]);
      guess[0] = alpha;
      const pose = corrected(this.linkage, guess);
      if (pose) return pose.x;
    }
    throw new LoopsOpen(this.block, alpha + nearest.x[0] - at);
  }

  row(guess) {
    const pose = corrected(this.linkage, guess);
    return pose?.rates ? pose : null;
  }

  follow(first, direction) {
    const rows = [first];
    let step = BRANCH_STEP;
    while (Math.abs(rows.at(-1).x[0] - first.x[0]) < TAU && step > MIN_BRANCH_STEP) {
      const row = this.row(predict(rows.at(-1), direction * step));
      if (row) rows.push(row);
      step = row ? Math.min(BRANCH_STEP, 2 * step) : step / 2;
    }
    return rows;
  }

  isClosed(rows) {
    const [start, end] = [rows[0], rows.at(-1)];
    if (end.x[0] - start.x[0] < TAU) return false;
    const back = predict(end, start.x[0] + TAU - end.x[0]);
    return poseDistance(this.linkage, back, start.x) <= MAX_BRANCH_JUMP;
  }

  checkSeam() {
    if (this.isTurn || this.last - this.first < TAU - 2 * BRANCH_STEP) return;
    try {
      this.x(this.first + 2 * BRANCH_STEP);
      this.x(this.last - 2 * BRANCH_STEP);
    } catch (error) {
      if (error instanceof LoopsOpen) return;
      throw error;
    }
    throw new Refusal(
      'its coupled loops are not back where they were after a turn of the crank: one crank angle has two poses, and such a linkage is not solved',
      'as suas malhas acopladas não voltam ao mesmo lugar após uma volta da manivela: um ângulo tem duas posições, e tal mecanismo não é resolvido',
    );
  }
}

function predict({ x, rates }, step) {
  return x.map((value, j) => value + step * (j ? rates[j - 1] : 1));
}

function oneTurn(rows, start) {
  const [low, high] = [rows[0].x[0], rows.at(-1).x[0]];
  if (high - low < TAU) return rows;
  const first = Math.min(Math.max(low, start - Math.PI), high - TAU);
  return rows.filter(({ x }) => first <= x[0] && x[0] <= first + TAU);
}
