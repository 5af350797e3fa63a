'use strict';
/* Poses: the geometric method, the textbook's Newton-Raphson, and the branch of coupled loops. */

// A guess of coupled loops that needs more correction may have left its branch [rad].
const TRUSTED = 0.05;
// Between the poses of a branch, and where steps smaller than this fail it ends [rad].
const BRANCH_STEP = 0.05;
const SHORTEST_STEP = 1e-9;
const BRANCH_TOLERANCE = 1e-9;
const BRANCH_ITERATIONS = 6;
// Starting points of the search for coupled loops; poses nearer than `SAME` are the same.
const STARTS = 400;
const SAME = 1e-6;

/** Return the vectors of all bodies at a crank angle [rad], in the linkage's assembly. */
function placedVectors(linkage, alpha, signs = linkage.signs) {
  const { structure } = linkage;
  const u = structure.bodies.map(() => null);
  u[0] = C.polar(1, structure.senses[0] * alpha);
  let moved = null;
  linkage.blocks.forEach((block, k) => {
    if (block.isDyad) {
      const [a, b] = block.unknowns;
      [u[a], u[b]] = block.place(u, signs[k]);
      return;
    }
    if (!moved) moved = branchVectors(linkage, alpha);
    for (const j of block.unknowns) u[j] = moved[j];
  });
  return u;
}

function branchVectors(linkage, alpha) {
  const known = linkage.branch.x(alpha);
  const x = linkage.structure.bodies.map(() => 0);
  linkage.headBodies.forEach((j, i) => {
    x[j] = known[i];
  });
  return linkage.vectors(x);
}

/** Return the pose at a crank angle, or why there is none: {u, x, points} or {error}. */
function poseAt(linkage, alpha, signs = linkage.signs) {
  try {
    const u = placedVectors(linkage, alpha, signs);
    const x = linkage.coordinates(u);
    x[0] = alpha;
    return { u, x, points: linkage.points(u), signs };
  } catch (error) {
    if (error instanceof Unreachable || error instanceof LoopsOpen) return { error };
    throw error;
  }
}

/**
 * Return every iterate x_(k+1) = x_k - Phi^-1 f of the textbook's Newton-Raphson, the guess first.
 *
 * `start` is the crank's angle and the guess; the answer is {x, residuals, converged, isSingular}.
 */
function newtonRaphson(linkage, start, most, tolerance) {
  const x = [start];
  const residuals = [];
  const told = (converged, isSingular = false) => {
    residuals.push(Math.max(...linkage.equations(x.at(-1)).f.map(Math.abs)));
    return { x, residuals, converged, isSingular };
  };
  for (let k = 0; k < most; k += 1) {
    const { f, phi } = linkage.equations(x.at(-1));
    const { x: correction } = solved(phi, f);
    if (!correction) return told(false, true);
    residuals.push(Math.max(...f.map(Math.abs)));
    const next = x.at(-1).map((value, j) => (j ? value - correction[j - 1] : value));
    if (!next.every(Number.isFinite)) return { x, residuals, converged: false, isSingular: true };
    x.push(next);
    if (Math.max(...correction.map(Math.abs)) <= tolerance) return told(true);
  }
  return told(false);
}

/** Return the pose {x, rates} that a guess leads to without leaving its branch, or null. */
function refined(linkage, start, tolerance, most) {
  const { bodies } = linkage.structure;
  let x = start;
  let isSettled = false;
  let now = null;
  for (let k = 0; ; k += 1) {
    if (k === most) return null;
    now = linkage.equations(x);
    const isClosed = linkage.blocks.every((block, b) =>
      linkage.structure.paths.rows[b].every(
        (row) => Math.max(Math.abs(now.f[2 * row]), Math.abs(now.f[2 * row + 1])) <= block.rounding,
      ),
    );
    if (isSettled || isClosed) break;
    const { x: correction } = solved(now.phi, now.f);
    if (!correction) return null;
    x = x.map((value, j) => (j ? value - correction[j - 1] : value));
    isSettled = correction.every((e, j) => Math.abs(e) <= tolerance * (bodies[j + 1].slides ? linkage.size : 1));
  }
  const sines = linkage.blocks.map((block, b) => block.sine(now.u) * linkage.signs[b]);
  const isOn = linkage.blocks.every((block, b) => !block.twoBranches || sines[b] >= -block.roundingOfSine);
  const isNear = x.every(
    (value, j) => Math.abs(value - start[j]) <= TRUSTED * (bodies[j].slides ? linkage.size : 1),
  );
  if (!isOn || !isNear) return null;
  const isSingular = linkage.blocks.some((block, b) => sines[b] <= block.singularSine);
  const crank = linkage.rows.flatMap(({ terms }) => columnOf(linkage.structure, terms, now.u, 0));
  const { x: rates } = isSingular ? { x: null } : solved(now.phi, crank);
  const wrapped = x.map((value, j) => (!j || bodies[j].slides ? value : wrap(value)));
  return { x: wrapped, rates: rates && rates.map((rate) => -rate) };
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
    let rows = this.walk(first, 1);
    if (!this.isClosed(rows)) {
      const back = this.walk(first, -1).slice(1).reverse();
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
    const near = this.rows.reduce((best, row) =>
      Math.abs(row.x[0] - at) < Math.abs(best.x[0] - at) ? row : best,
    );
    if (this.first <= at && at <= this.last) {
      const guess = ahead(near, at - near.x[0]);
      guess[0] = alpha;
      const found = refined(this.linkage, guess, BRANCH_TOLERANCE, BRANCH_ITERATIONS);
      if (found) return found.x;
    }
    throw new LoopsOpen(this.block, alpha + near.x[0] - at);
  }

  row(guess) {
    const found = refined(this.linkage, guess, BRANCH_TOLERANCE, BRANCH_ITERATIONS);
    return found && found.rates ? found : null;
  }

  walk(first, direction) {
    const rows = [first];
    let step = BRANCH_STEP;
    while (Math.abs(rows.at(-1).x[0] - first.x[0]) < TAU && step > SHORTEST_STEP) {
      const row = this.row(ahead(rows.at(-1), direction * step));
      if (row) rows.push(row);
      step = row ? Math.min(BRANCH_STEP, 2 * step) : step / 2;
    }
    return rows;
  }

  isClosed(rows) {
    const [start, end] = [rows[0], rows.at(-1)];
    if (end.x[0] - start.x[0] < TAU) return false;
    const back = ahead(end, start.x[0] + TAU - end.x[0]);
    return apartBy(this.linkage, back, start.x) <= TRUSTED;
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

function ahead({ x, rates }, step) {
  return x.map((value, j) => value + step * (j ? rates[j - 1] : 1));
}

function oneTurn(rows, start) {
  const [low, high] = [rows[0].x[0], rows.at(-1).x[0]];
  if (high - low < TAU) return rows;
  const first = Math.min(Math.max(low, start - Math.PI), high - TAU);
  return rows.filter(({ x }) => first <= x[0] && x[0] <= first + TAU);
}

/** Return by how much two poses differ at most [rad]; lengths by the linkage's size. */
function apartBy(linkage, x, other) {
  const { bodies } = linkage.structure;
  return Math.max(
    ...x.slice(1).map((value, i) => {
      const off = value - other[i + 1];
      return Math.abs(bodies[i + 1].slides ? off / linkage.size : wrap(off));
    }),
  );
}

/** Return the pose of every assembly at a crank angle, with its signs. */
function assemblyPoses(linkage, alpha, most = 64) {
  return linkage.isDyadic ? dyadPoses(linkage, alpha, most) : coupledPoses(linkage, alpha);
}

function dyadPoses(linkage, alpha, most) {
  const found = [];
  let stuck = [];
  for (const signs of allSigns(linkage)) {
    // What fails at a dyad fails whatever the signs from there on.
    if (stuck.length && stuck.slice(0, -1).every((sign, k) => sign === signs[k])) continue;
    const pose = poseAt(linkage, alpha, signs);
    if (!pose.error) found.push(pose);
    else stuck = signs.slice(0, pose.error.block);
    if (found.length === most) break;
  }
  return found;
}

function* allSigns(linkage, k = 0) {
  if (k === linkage.blocks.length) {
    yield [];
    return;
  }
  for (const sign of linkage.blocks[k].twoBranches ? [1, -1] : [1])
    for (const rest of allSigns(linkage, k + 1)) yield [sign, ...rest];
}

function coupledPoses(linkage, alpha) {
  const found = [];
  for (const guess of spreadGuesses(linkage)) {
    const { converged, x } = newtonRaphson(linkage, [alpha, ...guess], 30, 1e-10);
    if (!converged) continue;
    const last = x.at(-1).map((v, j) => (!j || linkage.structure.bodies[j].slides ? v : wrap(v)));
    if (found.some((pose) => apartBy(linkage, last, pose.x) <= SAME)) continue;
    const u = linkage.vectors(last);
    const sines = linkage.blocks.map((block) => block.sine(u));
    if (sines.some((s, b) => Math.abs(s) <= Math.max(LEAST_START_SINE, linkage.blocks[b].singularSine))) continue;
    found.push({ u, x: last, points: linkage.points(u), signs: sines.map(Math.sign) });
  }
  return found;
}

/** Return starting points, evenly spread over all coordinates, always the same. */
function spreadGuesses(linkage) {
  const bodies = linkage.structure.bodies.slice(1);
  // Kronecker's sequence of the roots of x^(n + 1) = x + 1: M. Roberts, 2018.
  let root = 2;
  for (let k = 0; k < 60; k += 1) root = (1 + root) ** (1 / (bodies.length + 1));
  return Array.from({ length: STARTS }, (_, k) =>
    bodies.map((body, i) => {
      const part = ((k + 1) * root ** -(i + 1)) % 1;
      return (2 * part - 1) * (body.slides ? 2 * linkage.size : Math.PI);
    }),
  );
}
