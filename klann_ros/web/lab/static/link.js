'use strict';
/*
 * The state of the page in its address, so that a link shares it:
 *
 *   #linkage=klann&numbers=120,350,...&crank=60&guess=15,60,45,60    a shipped linkage [mm, deg]
 *   #file=...&crank=60                                               the text of a file
 *
 *   #practice=newton&seed=12345&lang=pt                               an exercise, open_practice.js
 *
 * `assembly` has the signs of changed dyads, `start` the pose of changed coupled loops, `name` a
 * changed name. A new part is a line of LINK_PARTS, and what linkOf and openLink do with it.
 */

const MAX_LINK_LENGTH = 20000;
const MAX_CRANK = 1e6;
const DECIMAL = '-?\\d{1,30}(\\.\\d{1,30})?(e[+-]?\\d{1,3})?';
const DECIMALS = new RegExp(`^${DECIMAL}(,${DECIMAL}){0,199}$`);
const LINK_PARTS = {
  linkage: /^[a-z][a-z0-9_]{0,59}$/,
  file: /^[^]+$/,
  name: /^.{1,200}$/,
  numbers: DECIMALS,
  assembly: /^-?1(,-?1){0,99}$/,
  start: DECIMALS,
  crank: new RegExp(`^${DECIMAL}$`),
  guess: DECIMALS,
};

/** Return the units of a linkage's dimensions, or of its bodies' coordinates, in the page's [m, rad]. */
function dimensionUnits({ structure }) {
  return structure.dimensions.map(({ kind }) => (kind === 'bend' ? TAU / 360 : 0.001));
}

function coordinateUnits({ structure }) {
  return structure.bodies.map(({ slides }) => (slides ? 0.001 : TAU / 360));
}

function numbersText(numbers, units) {
  return numbers.map((value, n) => inUnit(value, units[n])).join();
}

/** Return the state as an address's fragment; a Refusal where it is too long for one. */
function linkOf(lab) {
  const { linkage, read, source, alpha, guess, name } = lab;
  const parts = {};
  if (Object.hasOwn(lab.shipped, source)) {
    parts.linkage = source;
    if (name !== read.content.name) parts.name = name;
    if (String(linkage.numbers) !== String(read.linkage.numbers))
      parts.numbers = numbersText(linkage.numbers, dimensionUnits(linkage));
    // As it is where the file's is told: beyond a change point the signs are others.
    const [now, told] = [linkage, read.linkage].map(({ changes }) =>
      changes.signsAt(read.linkage.reference).join(),
    );
    if (now !== told && linkage.isDyadic) parts.assembly = now;
    if (linkage !== read.linkage && !linkage.isDyadic)
      parts.start = numbersText(linkage.start, coordinateUnits(linkage));
  } else parts.file = linkageText(linkage, lab.content, lab.poseToSave().x, name);
  parts.crank = String(inUnit(alpha, TAU / 360));
  if (guess !== read.guess) parts.guess = numbersText(guess, coordinateUnits(linkage).slice(1));
  const encoded = (text) => encodeURIComponent(text).replaceAll('%2C', ',').replaceAll('%20', '+');
  const link = `#${Object.entries(parts)
    .map(([key, text]) => `${key}=${encoded(text)}`)
    .join('&')}`;
  refuseUnless(link.length <= MAX_LINK_LENGTH, TEXTS.en.linkTooLong, TEXTS.pt.linkTooLong);
  return link;
}

/** Show the state of an address's fragment; a Refusal says what of it is wrong. */
function openLink(lab, fragment) {
  const parts = linkParts(fragment);
  const refuse = (condition, en, pt) =>
    refuseUnless(condition, `the link: ${en}`, `o link: ${pt}`);
  const numbers = (key, units) => {
    const values = parts[key].split(',').map(Number);
    refuse(
      values.length === units.length,
      `${key} has ${values.length} numbers instead of ${units.length}`,
      `${key} tem ${values.length} números em vez de ${units.length}`,
    );
    refuse(values.every(Number.isFinite), `${key} is too large`, `${key} é grande demais`);
    return values.map((value, n) => value * units[n]);
  };
  refuse(
    'linkage' in parts !== 'file' in parts,
    'it needs either linkage or file',
    'falta linkage ou file',
  );
  if ('file' in parts) lab.load(parts.file);
  else {
    refuse(
      Object.hasOwn(lab.shipped, parts.linkage),
      `no shipped linkage is called ${printable(parts.linkage)}`,
      `nenhum mecanismo incluído se chama ${printable(parts.linkage)}`,
    );
    lab.choose(parts.linkage);
  }
  if ('name' in parts) aTitle((lab.name = parts.name), 'name');
  const { structure, kept, isDyadic } = lab.linkage;
  if ('numbers' in parts || 'assembly' in parts || 'start' in parts) {
    const changed =
      'numbers' in parts ? numbers('numbers', dimensionUnits(lab.linkage)) : lab.numbers;
    const branch = isDyadic ? { signs: lab.linkage.signs } : { start: lab.linkage.start };
    if ('start' in parts && !isDyadic)
      branch.start = numbers('start', coordinateUnits(lab.linkage));
    if ('assembly' in parts && isDyadic) {
      const signs = parts.assembly.split(',').map(Number);
      Object.assign(branch, lab.linkage.branchAt(lab.linkage.reference, signs));
      refuse(
        signs.length === structure.groups.length,
        `assembly needs ${structure.groups.length} signs`,
        `assembly precisa de ${structure.groups.length} sinais`,
      );
    }
    lab.change(new Linkage(structure, changed, { ...kept, ...branch }));
  }
  if ('crank' in parts) {
    const [alpha] = numbers('crank', [TAU / 360]);
    refuse(
      Math.abs(alpha) <= MAX_CRANK,
      'the crank angle is too large',
      'o ângulo da manivela é grande demais',
    );
    lab.turnTo(alpha);
  }
  if ('guess' in parts) lab.setGuess(numbers('guess', coordinateUnits(lab.linkage).slice(1)));
}

/** Return the parts of a fragment by their names. */
function linkParts(fragment, known = LINK_PARTS) {
  refuseUnless(
    fragment.length <= MAX_LINK_LENGTH,
    `the link has ${fragment.length} characters, more than ${MAX_LINK_LENGTH}`,
    `o link tem ${fragment.length} caracteres, mais de ${MAX_LINK_LENGTH}`,
  );
  const parts = {};
  for (const part of fragment.replace(/^#/, '').split('&')) {
    const [key, ...rest] = part.split('=');
    let text = null;
    try {
      text = decodeURIComponent(rest.join('=').replaceAll('+', ' '));
    } catch {
      // Not UTF-8: refused below.
    }
    const isGood = Object.hasOwn(known, key) && !(key in parts) && text !== null;
    refuseUnless(
      isGood && known[key].test(text),
      `the link cannot be read at ${printable(part, 40)}`,
      `o link não pode ser lido em ${printable(part, 40)}`,
    );
    parts[key] = text;
  }
  return parts;
}
