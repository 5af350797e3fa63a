'use strict';
/* Parameters of solver_node: a Klann leg by the numbers of its parameters. */

// What solver_node calls the numbers of a Klann leg; of the leg the course bends the other way.
const KLANN_NAMES = {
  'A-B': 'l_ab',
  'B-C': 'l_bc',
  'D-C': 'l_dc',
  'C-G': 'l_cg',
  'E-F': 'l_ef',
  'F-G': 'l_fg',
  'G-H': 'l_gh',
  'D.x': 'x_d',
  'A.y': 'y_a',
  'E.x': 'x_e',
  'E.y': 'y_e',
  'bend of C-G': 'angle_bcg',
  'bend of G-H': 'angle_fgh',
};

function fromParameters(content, klannText) {
  const nodes = Object.values(content).filter(
    (part) => isMapping(part) && 'ros__parameters' in part,
  );
  refuseUnless(
    nodes.length === 1 && isMapping(nodes[0].ros__parameters),
    'it has parameters of several nodes, or none: keep those of one solver_node',
    'tem parâmetros de vários nós, ou de nenhum: deixe os de um solver_node',
  );
  const given = nodes[0].ros__parameters;
  refuseUnless(
    !given.linkage,
    'its linkage is a file: load that file',
    'o seu linkage é um arquivo: abra esse arquivo',
  );
  const words = Object.values(KLANN_NAMES);
  for (const [key, value] of Object.entries(given)) {
    const own = isMapping(value) ? Object.keys(value) : [key.split('.').at(-1)];
    const isOfLeg =
      (isMapping(value) || key.includes('.')) && own.some((word) => words.includes(word));
    refuseUnless(
      !isOfLeg,
      `${printable(key)}: legs with lengths of their own: load one alone`,
      `${printable(key)}: pernas com comprimentos próprios: abra uma só`,
    );
  }
  return klannLeg(given, klannText);
}

/** Return the Klann leg of parameters; what is left out is that of SEM 104. */
function klannLeg(given, klannText) {
  const base = fromContent(readYaml(klannText));
  const { structure } = base.linkage;
  const numbers = structure.dimensions.map(({ name }, n) => {
    const word = KLANN_NAMES[name];
    if (!word || !(word in given)) return base.linkage.numbers[n];
    aNumber(given[word], word);
    return senseOf(name) * given[word];
  });
  const signs = 'assembly' in given ? given.assembly : [1, 1];
  listOf(oneOf(1, -1), 2)(signs, 'assembly');
  refuseUnless(signs.length === 2, 'assembly: two signs', 'assembly: dois sinais');
  const linkage = new Linkage(structure, numbers, { signs, name: 'Klann leg', outside: [2] });
  refuseUnless(
    closesSomewhere(linkage),
    `these lengths are refused: at no crank angle do both dyads close in the assembly [${signs.join(', ')}]`,
    `estes comprimentos são recusados: em nenhum ângulo as duas díades fecham na montagem [${signs.join(', ')}]`,
  );
  return { linkage, content: withoutSource(base.content) };
}

function withoutSource(content) {
  const copy = Object.assign(Object.create(null), content);
  delete copy.source;
  return copy;
}

/** Return whether a linkage is a Klann leg, whose numbers solver_node takes as parameters. */
function isKlannLeg({ structure }, klannText) {
  const { structure: klann } = fromContent(readYaml(klannText)).linkage;
  const drawn = ({ pivots, bodies, foot }) =>
    JSON.stringify([
      pivots,
      foot,
      bodies.map(({ name, clockwise, along, bars }) => [name, clockwise, along, bars]),
    ]);
  return drawn(structure) === drawn(klann);
}

/** Return the parameters of a Klann leg by its numbers' names; A is above the origin, D beside it. */
function klannParameters({ structure, numbers }) {
  const number = Object.fromEntries(structure.dimensions.map(({ name }, n) => [name, numbers[n]]));
  const moved = { x: -number['A.x'], y: -number['D.y'] };
  return Object.fromEntries(
    Object.entries(KLANN_NAMES).map(([name, word]) => {
      const value = number[name] + (/^[A-Z]\.[xy]$/.test(name) ? moved[name[2]] : 0);
      return [name, [word, senseOf(name) * value]];
    }),
  );
}

/** Return -1 of the bend that the course, and its parameter, has the other way; 1 of all others. */
function senseOf(name) {
  return KLANN_NAMES[name] === 'angle_fgh' ? -1 : 1;
}

/** Return the text of a parameter file. */
function parametersText(linkage) {
  const lines = Object.values(klannParameters(linkage)).map(
    ([word, value]) => `    ${word}: ${real(value)}\n`,
  );
  return [
    '# Saved by the lab of klann_ros: solver_node --ros-args --params-file THIS_FILE\n',
    '/**:\n  ros__parameters:\n',
    ...lines,
    `    assembly: [${linkage.signs.join(', ')}]\n`,
  ].join('');
}

/** Return a number with a point and without an exponent, as rcl wants it of a double. */
function real(value) {
  // The sixteenth digit is that of a unit's conversion.
  const text = String(Number(value.toPrecision(15)) || 0);
  if (/^-?\d+$/.test(text)) return `${text}.0`;
  return text.includes('e') ? value.toFixed(20).replace(/0+$/, '0') : text;
}
