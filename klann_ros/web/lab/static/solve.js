'use strict';
/* Poses: the geometric method, the textbook's Newton-Raphson, and the branch of coupled loops. */

/** Return the vectors of all bodies at a crank angle [rad], in the linkage's assembly. */
function closedFormVectors(linkage, alpha, signs = linkage.signs) {
  const { structure } = linkage;
  const u = structure.bodies.map(() => null);
  u[0] = C.polar(1, structure.senses[0] * alpha);
  let prefix = null;
  linkage.blocks.forEach((block, k) => {
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

/** Return the pose at a crank angle, or why there is none: {u, x, points} or {error}. */
function poseAt(linkage, alpha, signs = linkage.signs) {
  try {
    const u = closedFormVectors(linkage, alpha, signs);
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
function newtonRaphson(linkage, start, maxIterations, tolerance) {
  const x = [start];
  const residuals = [];
  const answer = (converged, isSingular = false) => {
    residuals.push(Math.max(...linkage.equations(x.at(-1)).f.map(Math.abs)));
    return { x, residuals, converged, isSingular };
  };
  for (let k = 0; k < maxIterations; k += 1) {
    const { f, phi } = linkage.equations(x.at(-1));
    const { x: correction } = solved(phi, f);
    if (!correction) return answer(false, true);
    residuals.push(Math.max(...f.map(Math.abs)));
    const next = x.at(-1).map((value, j) => (j ? value - correction[j - 1] : value));
    if (!next.every(Number.isFinite)) return { x, residuals, converged: false, isSingular: true };
    x.push(next);
    if (Math.max(...correction.map(Math.abs)) <= tolerance) return answer(true);
  }
  return answer(false);
}
