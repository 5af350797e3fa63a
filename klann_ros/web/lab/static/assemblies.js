'use strict';
/* The ways in which a linkage can be put together: see assemblies.py. */

// Starting points of the search for coupled loops, and the difference of poses that are the same.
const START_COUNT = 400;
const SAME_POSE = 1e-6;

/** Return the largest difference of two poses' coordinates [rad]; lengths by the linkage's size. */
function poseDistance(linkage, x, y) {
  const { bodies } = linkage.structure;
  return Math.max(
    ...x.slice(1).map((value, i) => {
      const difference = value - y[i + 1];
      return Math.abs(bodies[i + 1].slides ? difference / linkage.size : wrap(difference));
    }),
  );
}

/** Return the pose of every assembly at a crank angle, with its signs. */
function assemblyPoses(linkage, alpha, limit = 64) {
  return linkage.isDyadic ? dyadPoses(linkage, alpha, limit) : coupledPoses(linkage, alpha);
}

function dyadPoses(linkage, alpha, limit) {
  const poses = [];
  let failed = [];
  for (const signs of allSigns(linkage)) {
    // What fails at a dyad fails whatever the signs from there on.
    if (failed.length && failed.slice(0, -1).every((sign, k) => sign === signs[k])) continue;
    const pose = poseAt(linkage, alpha, signs);
    if (!pose.error) poses.push(pose);
    else failed = signs.slice(0, pose.error.block);
    if (poses.length === limit) break;
  }
  return poses;
}

function* allSigns(linkage, k = 0) {
  if (k === linkage.blocks.length) {
    yield [];
    return;
  }
  for (const sign of linkage.blocks[k].twoBranches ? [1, -1] : [1])
    for (const further of allSigns(linkage, k + 1)) yield [sign, ...further];
}

function coupledPoses(linkage, alpha) {
  const poses = [];
  for (const guess of spreadGuesses(linkage)) {
    const { converged, x } = newtonRaphson(linkage, [alpha, ...guess], 30, 1e-10);
    if (!converged) continue;
    const last = linkage.wrapped(x.at(-1));
    if (poses.some((pose) => poseDistance(linkage, last, pose.x) <= SAME_POSE)) continue;
    const u = linkage.vectors(last);
    const signs = linkage.blocks.map((block) => block.regularSign(u));
    if (signs.every(Boolean)) poses.push({ u, x: last, points: linkage.points(u), signs });
  }
  return poses;
}

/** Return starting points, evenly spread over all coordinates, always the same. */
function spreadGuesses(linkage) {
  const bodies = linkage.structure.bodies.slice(1);
  // Kronecker's sequence of the roots of x^(n + 1) = x + 1: M. Roberts, 2018.
  let root = 2;
  for (let k = 0; k < 60; k += 1) root = (1 + root) ** (1 / (bodies.length + 1));
  return Array.from({ length: START_COUNT }, (_, k) =>
    bodies.map((body, i) => {
      const part = ((k + 1) * root ** -(i + 1)) % 1;
      return (2 * part - 1) * (body.slides ? 2 * linkage.size : Math.PI);
    }),
  );
}
