'use strict';
/* The ways in which a linkage can be put together: see assemblies.py. */

// Starting points of the search for coupled loops; poses nearer than `SAME` are the same.
const STARTS = 400;
const SAME = 1e-6;

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
    if (
      sines.some(
        (s, b) => Math.abs(s) <= Math.max(LEAST_START_SINE, linkage.blocks[b].singularSine),
      )
    )
      continue;
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
