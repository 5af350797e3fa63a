'use strict';
/* The order in which a linkage is assembled, its loops, and the ways to its points. */

const MAX_BODIES = 25;
// All subsets of the bodies are tried; what needs more of them than these is no file that is meant.
const MAX_TRIES = 30000;

/** Return the groups of bodies that are placed together, in their order: see assembly.py. */
function assemblyOrder(structure) {
  const count = structure.bodies.length;
  refuseUnless(
    count <= MAX_BODIES,
    `there are ${count} bodies: more than ${MAX_BODIES} are not solved`,
    `há ${count} corpos: mais de ${MAX_BODIES} não são resolvidos`,
  );
  checkConnected(structure);
  const [crank] = structure.angles;
  refuseUnless(
    !countLoops(structure, [0]),
    `the crank ${crank} holds two pivots and cannot turn`,
    `a manivela ${crank} une duas articulações fixas e não pode girar`,
  );
  let placed = [0];
  let free = structure.bodies.map((_, j) => j).slice(1);
  const groups = [];
  const budget = { left: MAX_TRIES };
  while (free.length) {
    const group = nextGroup(structure, placed, free, budget);
    groups.push(group);
    placed = [...placed, ...group];
    free = free.filter((j) => !group.includes(j));
  }
  refuseUnless(
    groups.length,
    'no loop closes: two bodies must lead to the same point',
    'nenhuma malha fecha: dois corpos têm de levar ao mesmo ponto',
  );
  return groups;
}

/** Return the fewest bodies that close a loop for every two of them. */
function nextGroup(structure, placed, free, budget) {
  const loops = countLoops(structure, placed);
  for (let size = 1; size <= free.length; size += 1) {
    for (const group of combinations(free, size)) {
      budget.left -= 1;
      refuseUnless(
        budget.left > 0,
        'its bodies are too many and too entangled to be ordered here',
        'os seus corpos são demais e estão emaranhados demais para serem ordenados aqui',
      );
      const tried = [...placed, ...group];
      const carriers = [null, FIXED, ...tried];
      if (!tried.every((j) => carriers.includes(structure.along[j]))) continue;
      const closed = countLoops(structure, tried) - loops;
      const names = group.map((j) => structure.angles[j]).join(', ');
      refuseUnless(
        2 * closed <= size,
        `${names}: cannot move, since ${2 * closed} loop equations stand against ${size} unknowns`,
        `${names}: não pode mover-se: ${2 * closed} equações de malha contra ${size} incógnitas`,
      );
      if (2 * closed === size) return group;
    }
  }
  const all = [...placed, ...free];
  const total = countLoops(structure, all);
  const isLoose = (j) =>
    countLoops(
      structure,
      all.filter((i) => i !== j),
    ) === total;
  const loose = free.filter(isLoose);
  const names = (loose.length ? loose : free).map((j) => structure.angles[j]).join(', ');
  if (loose.length)
    throw new Refusal(
      `${names}: turns freely, since no loop closes over it`,
      `${names}: gira livremente, pois nenhuma malha se fecha sobre ele`,
    );
  throw new Refusal(
    `the crank alone does not move it in one definite way: ${free.length} unknowns (${names}) and ${2 * (total - loops)} loop equations`,
    `só a manivela não o move de modo definido: ${free.length} incógnitas (${names}) e ${2 * (total - loops)} equações de malha`,
  );
}

function* combinations(items, size, from = 0) {
  if (!size) {
    yield [];
    return;
  }
  for (let i = from; i <= items.length - size; i += 1)
    for (const rest of combinations(items, size - 1, i + 1)) yield [items[i], ...rest];
}

/** Return how many independent loops some bodies and the ground close. */
function countLoops(structure, bodies) {
  const parent = new Map();
  const root = (node) => {
    let top = node;
    while (parent.has(top) && parent.get(top) !== top) top = parent.get(top);
    return top;
  };
  // The space keeps a body's node apart from every point's name; the ground is body -1.
  const edges = structure.pivots.map((point) => [FIXED, point]);
  for (const j of bodies) {
    for (const point of structure.bodies[j].points) edges.push([j, point]);
    if (structure.along[j] !== null) edges.push([j, `body ${structure.along[j]}`]);
  }
  let loops = 0;
  for (const [body, node] of edges) {
    const bodyRoot = root(`body ${body}`);
    const nodeRoot = root(node);
    if (bodyRoot === nodeRoot) loops += 1;
    else parent.set(bodyRoot, nodeRoot);
  }
  return loops;
}

function checkConnected(structure) {
  const reached = new Set([FIXED, ...structure.pivots]);
  let loose = structure.bodies.map((_, j) => j);
  while (loose.length) {
    const joined = loose.filter(
      (j) =>
        (structure.along[j] !== null && reached.has(structure.along[j])) ||
        structure.bodies[j].points.some((point) => reached.has(point)),
    );
    const name = structure.angles[loose[0]];
    refuseUnless(
      joined.length,
      `body ${name} is connected to no pivot, not even by other bodies`,
      `o corpo ${name} não está ligado a nenhuma articulação fixa, nem por outros corpos`,
    );
    for (const j of joined)
      for (const node of [j, ...structure.bodies[j].points]) reached.add(node);
    loose = loose.filter((j) => !joined.includes(j));
  }
}

/** Return the loops, where each closes, which loops each group closes, and the ways to all points. */
function loopPaths(structure) {
  const ways = new Map();
  structure.pivots.forEach((name, place) => {
    ways.set(name, { pivots: new Map([[place, 1]]), bars: new Map() });
  });
  const paths = { loops: [], closing: [], rows: [], points: [] };
  [[0], ...structure.groups].forEach((group, number) => {
    const closed = grow(structure, group, ways);
    if (number) paths.rows.push(closed.map((_, k) => paths.loops.length + k));
    for (const [point, path] of number ? closed : []) {
      paths.closing.push(point);
      paths.loops.push(path);
    }
  });
  paths.points = structure.points.map((name) => ways.get(name));
  return paths;
}

/** Reach the points of a group; return the loops that are closed on the way. */
function grow({ bars }, group, ways) {
  let free = group.flatMap((j) =>
    bars.map(({ body }, n) => (body === j ? n : -1)).filter((n) => n >= 0),
  );
  const closed = [];
  const away = ({ bar }) => ways.get(ways.has(bar.from) ? bar.from : bar.to).bars.size;
  while (free.length) {
    const reached = free.filter((n) => ways.has(bars[n].bar.from) || ways.has(bars[n].bar.to));
    const number = reached.reduce((best, n) => (away(bars[n]) < away(bars[best]) ? n : best));
    free = free.filter((n) => n !== number);
    const { from, to } = bars[number].bar;
    const [begin, point, sign] = ways.has(from) ? [from, to, 1] : [to, from, -1];
    const path = sumOf(ways.get(begin), { pivots: new Map(), bars: new Map([[number, sign]]) }, 1);
    if (ways.has(point)) closed.push([point, sumOf(path, ways.get(point), -1)]);
    else ways.set(point, path);
  }
  return closed;
}

function sumOf(path, addend, sign) {
  const added = (key) => {
    const total = new Map(path[key]);
    for (const [number, times] of addend[key])
      total.set(number, (total.get(number) || 0) + sign * times);
    return new Map([...total].filter(([, times]) => times).sort(([a], [b]) => a - b));
  };
  return { pivots: added('pivots'), bars: added('bars') };
}
