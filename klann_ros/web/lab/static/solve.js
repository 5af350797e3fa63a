'use strict';
/* Poses: the geometric method, the textbook's Newton-Raphson, and the branch of coupled loops. */

/**
 * Return the vectors of all bodies at a crank angle [rad], in an assembly.
 *
 * Or of those that the first `count` blocks place; `visit` is called before each block.
 */
function placedVectors(linkage, alpha, signs, count = linkage.blocks.length, visit = () => {}) {
  const { structure } = linkage;
  const u = structure.bodies.map(() => null);
  u[0] = C.polar(1, structure.senses[0] * alpha);
  let prefix = null;
  linkage.blocks.slice(0, count).forEach((block, k) => {
    visit(block, u);
    if (block.isDyad) {
      const [a, b] = block.unknowns;
      [u[a], u[b]] = block.place(u, signs[k]);
      return;
    }
    if (!prefix) prefix = branchVectors(linkage, alpha);
    for (const j of block.unknowns) u[j] = prefix[j];
  });
  return u;
}

function branchVectors(linkage, alpha) {
  const coordinates = linkage.branch.x(alpha);
  const x = linkage.structure.bodies.map(() => 0);
  linkage.headBodies.forEach((j, i) => {
    x[j] = coordinates[i];
  });
  return linkage.vectors(x);
}

/**
 * Return the pose at a crank angle, or why there is none: {u, x, points, signs} or {error}.
 *
 * The angle counts all turns; `signs` are another assembly than that of the motion there.
 */
function poseAt(linkage, alpha, signs = null) {
  const { changes } = linkage;
  try {
    const x = signs ? null : changes.through(alpha);
    const u = x
      ? linkage.vectors(x)
      : placedVectors(linkage, alpha, signs || changes.signsAt(alpha));
    const all = x ? linkage.wrapped(x) : linkage.coordinates(u);
    all[0] = alpha;
    return { u, x: all, points: linkage.points(u), signs: signs || changes.signsAt(alpha) };
  } catch (error) {
    if (error instanceof Unreachable || error instanceof LoopsOpen) return { error };
    throw error;
  }
}

// All digits of corrections and iterates; no f [m] is small enough to end with it alone.
const UNROUNDED = { correction: (value) => value, iterate: (value) => value, uncertainty: 0 };

/**
 * Return every iterate x_(k+1) = x_k - Phi^-1 f of the textbook's Newton-Raphson, the guess first.
 *
 * `start` is the crank's angle and the guess; the answer is {x, residuals, converged, isSingular}.
 * `rounding` rounds the corrections and iterates of the step k, as a calculation by hand does, and
 * ends where every f is below its uncertainty.
 */
function newtonRaphson(linkage, start, maxIterations, tolerance, rounding = UNROUNDED) {
  const x = [start];
  const residuals = [];
  const answer = (converged, isSingular = false) => {
    residuals.push(Math.max(...linkage.equations(x.at(-1)).f.map(Math.abs)));
    return { x, residuals, converged, isSingular };
  };
  for (let k = 0; k < maxIterations; k += 1) {
    const { f, phi } = linkage.equations(x.at(-1));
    const { x: solution } = solved(phi, f);
    if (!solution) return answer(false, true);
    residuals.push(Math.max(...f.map(Math.abs)));
    const correction = solution.map((value) => rounding.correction(value, k));
    const next = x
      .at(-1)
      .map((value, j) => (j ? rounding.iterate(value - correction[j - 1], k) : value));
    if (!next.every(Number.isFinite)) return { x, residuals, converged: false, isSingular: true };
    x.push(next);
    if (Math.max(...correction.map(Math.abs)) <= tolerance) return answer(true);
    const isClosed = ({ f: gaps }) => gaps.every((gap) => Math.abs(gap) < rounding.uncertainty);
    if (rounding.uncertainty && isClosed(linkage.equations(next))) return answer(true);
  }
  return answer(false);
}
