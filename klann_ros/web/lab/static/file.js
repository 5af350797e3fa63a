'use strict';
/* A linkage from the text of a file, and the text of a file from a linkage: see linkage/file.py. */

const METRES = { m: 1, cm: 0.01, mm: 0.001 };
// A drawing is as good as this [rad].
const NEAR_START = TAU / 12;
/** Return what a text holds: {linkage, content, start}; `start` is a crank angle [rad]. */
function readFile(text, klannText) {
  const content = readYaml(text);
  if (
    isMapping(content) &&
    Object.values(content).some((part) => isMapping(part) && 'ros__parameters' in part)
  )
    return fromParameters(content, klannText);
  return fromContent(content);
}

function fromContent(written) {
  checkLinkageContent(written);
  const content = byBars(written);
  const { metre, turn, inDegrees } = unitsOf(content);
  const order = orderOf(content);
  refuseUnless(
    content.crank in content.bodies,
    `the crank ${content.crank} is none of the bodies: ${order.slice(1).join(', ')}`,
    `a manivela ${content.crank} não é um dos corpos: ${order.slice(1).join(', ')}`,
  );
  if (content.start) checkStart(content.start, order);
  const structure = new Structure(
    Object.keys(content.pivots),
    order.map((name) => bodyOf(name, content.bodies[name])),
    content.foot,
  );
  const numbers = structure.dimensions.map((dimension) =>
    numberIn(content, structure, dimension, { metre, turn }),
  );
  const plain = new Linkage(structure, numbers, {
    signs: structure.groups.map(() => 1),
    name: content.name,
    atChangePoints: content.at_change_points,
  });
  if (!content.start) return { linkage: stated(plain, content.assembly), content };
  const start = structure.bodies.map(
    (body) => (body.slides ? metre : turn) * content.start[body.name],
  );
  const linkage =
    content === written
      ? reachedFrom(plain, start, content.assembly, inDegrees)
      : atPoints(plain, start, content.assembly);
  if (!linkage.isDyadic) void linkage.branch;
  return { linkage, content, start: start[0] };
}

function unitsOf({ units = {} }) {
  const inDegrees = units.angle === 'deg';
  return { metre: METRES[units.length || 'm'], turn: inDegrees ? TAU / 360 : 1, inDegrees };
}

function orderOf({ crank, bodies }) {
  return [crank, ...Object.keys(bodies).filter((name) => name !== crank)];
}

/** Return the bars of a body in a file, the line that it slides along being the first. */
function everyBar(body) {
  return [...(body.slides ? [body.slides] : []), ...(body.bars || [])];
}

function bodyOf(name, body) {
  const bars = everyBar(body).map(({ from, to, brace }) => ({ from, to, brace: brace || null }));
  return {
    name,
    clockwise: body.clockwise === true,
    along: body.slides ? body.slides.along : '',
    bars,
  };
}

function checkStart(start, order) {
  for (const name of Object.keys(start))
    refuseUnless(
      order.includes(name),
      `start has an angle for ${name}, which is no body`,
      `start tem um ângulo para ${name}, que não é um corpo`,
    );
  for (const name of order)
    refuseUnless(
      name in start,
      `start has no angle for ${name}: it needs one for every body`,
      `start não tem ângulo para ${name}: é preciso um para cada corpo`,
    );
}

/** Return where a dimension stands in a file: its mapping or list, and its key. */
function slotOf(content, structure, { kind, place }) {
  if (kind === 'x' || kind === 'y')
    return [content.pivots[structure.pivots[place]], kind === 'x' ? 0 : 1];
  const { body } = structure.bars[place];
  const bar = everyBar(content.bodies[structure.angles[body]])[place - structure.firsts[body]];
  if (kind === 'brace') return [bar.brace, 'length'];
  if (kind === 'length') return [bar, 'length'];
  return [bar, structure.isLine[place] ? 'direction' : 'bend'];
}

function numberIn(content, structure, dimension, { metre, turn }) {
  const [holder, key] = slotOf(content, structure, dimension);
  return (dimension.kind === 'bend' ? turn : metre) * (holder[key] || 0);
}

/** Return a linkage in the assembly that its start leads to. */
function reachedFrom(plain, start, signs, inDegrees) {
  if (!inDegrees) checkDegrees(plain, start);
  const { name, atChangePoints } = plain;
  const linkage = new Linkage(plain.structure, plain.numbers, { start, name, atChangePoints });
  refuseUnless(
    !signs || String(signs) === String(linkage.signs),
    `the start leads to the assembly [${linkage.signs.join(', ')}], and [${(signs || []).join(', ')}] is stated: leave one of them out`,
    `o start leva à montagem [${linkage.signs.join(', ')}], e [${(signs || []).join(', ')}] é declarada: retire uma delas`,
  );
  return linkage;
}

/** Refuse a start [rad] that can only be degrees. */
function checkDegrees(linkage, start) {
  const { bodies } = linkage.structure;
  const isBeyond = start.some((value, j) => !bodies[j].slides && Math.abs(value) > TAU);
  const isNear = nearestAssembly(linkage, start) <= NEAR_START;
  if (isNear && !isBeyond) return;
  const turned = start.map((value, j) => (bodies[j].slides ? value : (value * TAU) / 360));
  refuseUnless(
    !(nearestAssembly(linkage, turned) <= NEAR_START || (isBeyond && !isNear)),
    'the start is in radians near no pose in which it closes; for degrees write units: {angle: deg}',
    'o start, em radianos, não está perto de posição que feche; para graus escreva units: {angle: deg}',
  );
}

function nearestAssembly(linkage, start) {
  const reached = newtonRaphson(linkage, start, 30, 1e-10);
  const distances = reached.converged ? [poseDistance(linkage, reached.x.at(-1), start)] : [];
  if (linkage.isDyadic && linkage.blocks.length <= 8)
    distances.push(
      ...dyadPoses(linkage, start[0], Infinity).map(({ x }) => poseDistance(linkage, x, start)),
    );
  return Math.min(Infinity, ...distances);
}

/** Return a linkage without a start in the assembly that is stated, if it closes anywhere. */
function stated(plain, signs) {
  // Refused: coupled loops need a start.
  if (!plain.isDyadic) void plain.start;
  const count = plain.blocks.length;
  const linkage = signs.length === count ? plain.with(plain.numbers, { signs }) : null;
  refuseUnless(
    linkage &&
      plain.blocks.every((block, k) => block.twoBranches || signs[k] === 1) &&
      closesSomewhere(linkage),
    `assembly [${signs.join(', ')}] is refused: it needs ${count} signs with which it closes somewhere`,
    `a montagem [${signs.join(', ')}] é recusada: são precisos ${count} sinais com que feche em algum lugar`,
  );
  return linkage;
}

// Writing.

/** Return the text of a linkage's file; its start is a pose in which it closes. */
function linkageText(linkage, content, x, name) {
  const { metre, turn } = unitsOf(content);
  const copy = structuredCopy(content);
  copy.name = name;
  delete copy.assembly;
  // The start is a pose of the motion as it is drawn.
  if (copy.at_change_points === CROSSED) copy.at_change_points = PARALLEL;
  const { structure } = linkage;
  structure.dimensions.forEach((dimension, n) => {
    const [holder, key] = slotOf(copy, structure, dimension);
    const unit = dimension.kind === 'bend' ? turn : metre;
    if (linkage.numbers[n] || key in holder) holder[key] = inUnit(linkage.numbers[n], unit);
  });
  copy.start = Object.create(null);
  structure.bodies.forEach((body, j) => {
    copy.start[body.name] = inUnit(
      j || body.slides ? x[j] : wrap(x[j]),
      body.slides ? metre : turn,
    );
  });
  const head =
    '# Saved by the lab of klann_ros: solver_node --ros-args -p linkage:=THIS_FILE\n';
  return head + writeYaml(copy);
}

/** Return a number in a unit, as short as it can be written and read again. */
function inUnit(value, unit) {
  const shown = value / unit;
  for (let digits = 6; digits <= 17; digits += 1) {
    const text = Number(shown.toPrecision(digits));
    if (unit * text === value) return text;
  }
  return shown;
}

function structuredCopy(value) {
  if (Array.isArray(value)) return value.map(structuredCopy);
  return isMapping(value) ? mapped(value, structuredCopy) : value;
}
