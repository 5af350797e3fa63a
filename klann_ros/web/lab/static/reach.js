'use strict';
/* Where a crank can be, where it jams, and what the foot does meanwhile: see reach.py, arcs.py. */

const SAMPLES = 360;
const GOLDEN = (Math.sqrt(5) - 1) / 2;

/** Return the arcs [start, end] of crank angles at which every loop closes [rad]. */
function reachableArcs(linkage) {
  let { blocks } = linkage;
  let arcs = [[0, TAU]];
  if (!linkage.isDyadic) {
    arcs = [linkage.branch.arc];
    blocks = blocks.filter((block) => block.isDyad);
  } else if (isDriven(blocks[0])) {
    arcs = drivenArcs(blocks[0]);
    blocks = blocks.slice(1);
  }
  if (!blocks.length) return normalizeArcs(linkage.isDyadic ? arcs.map(trimEnds) : arcs);
  const clearance = (alpha) => {
    const { u, error } = poseAt(linkage, alpha);
    // Where the ends of a dyad coincide nothing closes, although nothing is short.
    if (error) return Math.min(-(error.shortfall || 0), -1e-300);
    return Math.max(0, Math.min(...blocks.map((block) => block.clearance(u))));
  };
  return normalizeArcs(arcs.flatMap((arc) => arcsInside(clearance, arc)));
}

function closesSomewhere(linkage) {
  for (let k = 0; k < 8; k += 1) if (!poseAt(linkage, (k * TAU) / 8).error) return true;
  return reachableArcs(linkage).length > 0;
}

/** Return whether a block is a dyad of two links whose ends the crank alone moves. */
function isDriven(block) {
  const moving = [0, ...block.unknowns];
  const [{ terms }] = block.rows;
  return block.isDyad && !block.slides && terms.size === 3 && moving.every((j) => terms.has(j));
}

/** Return the lengths of ground, crank and both links, and the crank angle along the ground [rad]. */
function drivenLengths(block) {
  const [{ terms, constant }] = block.rows;
  const vectors = [constant, terms.get(0), ...block.unknowns.map((j) => terms.get(j))];
  const direction = C.arg(C.div(C.times(-1, constant), terms.get(0)));
  return { lengths: vectors.map(C.abs), ground: block.structure.senses[0] * direction };
}

function drivenArcs(block) {
  const { lengths, ground } = drivenLengths(block);
  const [l1, l2, l3, l4] = lengths;
  const rounding = CONTACT_ROUNDING * Math.max(...lengths);
  if (l1 + l2 < Math.abs(l3 - l4) - rounding || Math.abs(l1 - l2) > l3 + l4 + rounding) return [];
  const passesFolded = Math.abs(l1 - l2) >= Math.abs(l3 - l4) - rounding;
  const passesStretched = l1 + l2 <= l3 + l4 + rounding;
  const smallest = !l1 || passesFolded ? 0 : triangleAngle(l1, l2, Math.abs(l3 - l4));
  const largest = !l1 || passesStretched ? Math.PI : triangleAngle(l1, l2, l3 + l4);
  if (smallest === 0 && largest === Math.PI) return [[0, TAU]];
  if (smallest === 0) return [[ground - largest, ground + largest]];
  if (largest === Math.PI) return [[ground + smallest, ground + TAU - smallest]];
  return [
    [ground + smallest, ground + largest],
    [ground - largest, ground - smallest],
  ];
}

/**
 * Return Grashof's law for lengths [m] of ground, crank, coupler and rocker: see mobility.py.
 *
 * The kind is '' where one is longer than the others together, so that they close nowhere.
 */
function grashofOf(lengths) {
  const [s, p, q, l] = [...lengths].sort((a, b) => a - b);
  const rounding = CONTACT_ROUNDING * l;
  const margin = p - s - (l - q);
  const order = Math.abs(margin) <= rounding ? 'III' : margin > 0 ? 'I' : 'II';
  const kind = l > s + p + q + rounding ? '' : order;
  const turns = lengths.map((length) => Math.min(length, lengths[0]) <= s + rounding);
  const motions = [['double rocker', 'rocker-crank'], ['crank-rocker', 'double crank']];
  const motion = motions[Number(turns[1])][Number(turns[3])];
  return { sums: [s + l, p + q], kind, motion: kind === 'II' ? 'triple rocker' : motion };
}

/** Return the four-bar that the crank drives: {names, lengths, rocker}; null where there is none. */
function fourBarOf({ structure, blocks }) {
  const { bodies } = structure;
  if (!blocks.length || !isDriven(blocks[0])) return null;
  const pair = blocks[0].unknowns;
  const isRocker = pair.map((j) => isGuided(structure, bodies[j]));
  if (isRocker[0] === isRocker[1]) return null;
  const { lengths } = drivenLengths(blocks[0]);
  if (isRocker[0]) lengths.push(lengths.splice(2, 1)[0]);
  const rocker = pair[isRocker.indexOf(true)];
  return { names: [0, ...pair].map((j) => bodies[j].name), lengths, rocker };
}

/** Return where a rocker turns back, as extremesOf does [rad]. */
function rockerLimits(linkage, { pieces, isTurn }, rocker) {
  const first = pieces[0][0].x[rocker];
  return extremesOf(linkage, pieces, ({ x }) => first + wrap(x[rocker] - first), isTurn);
}

/** Return the angle between two sides of a triangle [rad]. */
function triangleAngle(p, q, opposite) {
  const root = (square) => Math.sqrt(Math.max(0, square));
  const sine = root((opposite - (p - q)) * (opposite + (p - q)));
  return 2 * Math.atan2(sine, root((p + q - opposite) * (p + q + opposite)));
}

function trimEnds([start, end]) {
  const cut = end - start >= TAU ? 0 : 5e-13 * (end - start);
  return [start + cut, end - cut];
}

/** Return the parts of an arc at which a clearance is not negative. */
function arcsInside(clearance, arc) {
  const samples = withExtrema(clearance, samplesOver(arc));
  const closes = samples.map((alpha) => clearance(alpha) >= 0);
  const arcs = [];
  let start = closes[0] ? samples[0] : null;
  for (let i = 1; i < samples.length; i += 1) {
    if (closes[i] && !closes[i - 1]) start = boundary(clearance, samples[i], samples[i - 1]);
    else if (closes[i - 1] && !closes[i] && start !== null) {
      arcs.push([start, boundary(clearance, samples[i - 1], samples[i])]);
      start = null;
    }
  }
  if (start !== null) arcs.push([start, samples.at(-1)]);
  return arcs;
}

/** Return angles over an arc: the denser the nearer its ends, where clearances are steep. */
function samplesOver([start, end]) {
  const middle = (start + end) / 2;
  const half = ((end - start) / 2) * (1 - 1e-12);
  const isTurn = end - start >= TAU;
  return Array.from({ length: SAMPLES + 1 }, (_, k) =>
    isTurn ? start + (k * TAU) / SAMPLES : middle - half * Math.cos((Math.PI * k) / SAMPLES),
  );
}

/** Add the peaks and dips that the samples on their two sides may hide. */
function withExtrema(clearance, samples) {
  const [first, last] = [samples[0], samples.at(-1)];
  const angles = last - first >= TAU ? [samples.at(-2) - TAU, ...samples] : samples;
  const clearances = angles.map(clearance);
  const extrema = [];
  for (let i = 1; i < angles.length - 1; i += 1) {
    const [left, middle, right] = [clearances[i - 1], clearances[i], clearances[i + 1]];
    if (middle < 0 && left <= middle && middle >= right)
      extrema.push(peak(clearance, angles[i - 1], angles[i + 1]));
    else if (middle >= 0 && middle < Infinity && left >= middle && middle <= right)
      extrema.push(peak((alpha) => -clearance(alpha), angles[i - 1], angles[i + 1]));
  }
  const wrapped = extrema.map((alpha) => (alpha >= first ? alpha : alpha + TAU));
  return [...samples, ...wrapped].sort((a, b) => a - b);
}

/** Return where a function with one peak between two angles is greatest (golden section). */
function peak(f, from, to) {
  let [left, right] = [from, to];
  while (right - left > 1e-9) {
    const a = right - GOLDEN * (right - left);
    const b = left + GOLDEN * (right - left);
    if (f(a) > f(b)) right = b;
    else left = a;
  }
  return (left + right) / 2;
}

function boundary(clearance, inside, outside) {
  let [closes, fails] = [inside, outside];
  while (Math.abs(closes - fails) > 1e-13 * Math.max(1, Math.abs(closes))) {
    const middle = (closes + fails) / 2;
    if (middle === closes || middle === fails) break;
    if (clearance(middle) >= 0) closes = middle;
    else fails = middle;
  }
  return closes;
}

/** Bring the arcs' starts into [0, 2 pi), sort them, and join the two ends of the turn. */
function normalizeArcs(arcs) {
  const sorted = arcs
    .map(([start, end]) => {
      const first = start >= 0 && start < TAU ? start : ((start % TAU) + TAU) % TAU;
      return [first, first === start ? end : first + (end - start)];
    })
    .sort((a, b) => a[0] - b[0]);
  if (sorted.length > 1 && sorted[0][0] === 0 && sorted.at(-1)[1] >= TAU) {
    const [first, last] = [sorted.shift(), sorted.pop()];
    sorted.push([last[0], first[1] + TAU]);
  }
  return sorted;
}

/** Return what the foot and the dyads do over all arcs: the path, its extent, and figures. */
function turnOf(linkage, arcs, samples = SAMPLES) {
  const isTurn = arcs.length === 1 && arcs[0][1] - arcs[0][0] >= TAU;
  // After change points it may take several turns until it is back.
  const spans = isTurn ? [[0, linkage.changes.period * TAU]] : arcs;
  const pieces = spans.map(([start, end]) => {
    const count = Math.max(32, Math.round((samples * (end - start)) / TAU));
    const half = (end - start) / 2;
    return Array.from({ length: count + 1 }, (_, k) =>
      isTurn ? start + (k * TAU) / count : start + half * (1 - Math.cos((Math.PI * k) / count)),
    )
      .map((alpha) => poseAt(linkage, alpha))
      .filter(({ error }) => !error);
  });
  const foot = linkage.structure.points.indexOf(linkage.structure.foot);
  const extent = (axis) => {
    const value = (pose) => pose.points[foot][axis];
    return extremesOf(linkage, pieces, value, isTurn);
  };
  const angles = linkage.blocks.map((block) =>
    extremesOf(linkage, pieces, (pose) => block.transmissionAngle(pose.u), isTurn),
  );
  return { isTurn, arcs, pieces, foot, x: extent(0), y: extent(1), angles };
}

/** Return the least and the greatest value over poses, found between the samples. */
function extremesOf(linkage, pieces, value, isTurn) {
  const found = { least: Infinity, greatest: -Infinity, leastAt: NaN, greatestAt: NaN };
  const take = (pose) => {
    const v = value(pose);
    if (v < found.least) Object.assign(found, { least: v, leastAt: pose.x[0] });
    if (v > found.greatest) Object.assign(found, { greatest: v, greatestAt: pose.x[0] });
  };
  for (const poses of pieces) {
    poses.forEach(take);
    const count = poses.length;
    const step = isTurn ? poses[1].x[0] - poses[0].x[0] : 0;
    for (const sign of [1, -1]) {
      // Only about the greatest of the samples: the others cannot be the greatest of all.
      const values = poses.map((pose) => sign * value(pose));
      const i = values.indexOf(Math.max(...values));
      if (!isTurn && (i <= 0 || i >= count - 1)) continue;
      const at = poses[i].x[0];
      const [left, right] = isTurn
        ? [at - step, at + step]
        : [poses[i - 1].x[0], poses[i + 1].x[0]];
      const best = peak(
        (alpha) => {
          const pose = poseAt(linkage, alpha);
          return pose.error ? -Infinity : sign * value(pose);
        },
        left,
        right,
      );
      const pose = poseAt(linkage, best);
      if (!pose.error) take(pose);
    }
  }
  return found;
}
