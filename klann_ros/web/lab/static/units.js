'use strict';
/* Quantities as people write them: klann_ros/sanitize/quantity.py; a table is units.yaml. */

const MAX_QUANTITY = 64;
const QUANTITY =
  /^([+-]?) ?((?:\d(?:[\d.,]| (?=\d{3}(?!\d)))*|[.,]\d+)) ?(?:\/ ?(\d+) ?)?(?:(?:e|[x*·×] ?10 ?(?:\^|\*\*)?) ?\(?([+-]?\d{1,3})\)?)? ?(.*)$/i;
const GROUPED = /^([1-9]\d{0,2}([ .,])\d{3}(?:\2\d{3})*)(?:(?!\2)([.,]\d*))?$/;
const SEXAGESIMAL = /(\d+) ?[°º˚] ?([0-5]?\d(?:[.,]\d+)?) ?'(?: ?([0-5]?\d(?:[.,]\d+)?) ?")?/g;
const UNIT_FACTOR =
  / ?(?:([*·⋅×./-]) ?)?(\(*) ?(?:([A-Za-zµμ]+)(?:(?: ?(?:\^|\*\*) ?)?(\([+-]?\d\)|[+-]?\d))?|([°º˚'"π])) ?(\)*)/y;
const EXPONENTS = '⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻';

/**
 * Return the number of a text in a unit, by the table of units; null where it is none, NaN where
 * its own unit is of another dimension.
 */
function readQuantity(table, text, unit = '') {
  const plain = text.length <= 4 * MAX_QUANTITY ? tidyText(text) : '';
  if ([...plain].length > MAX_QUANTITY) return null;
  const found = plain
    .replace(/^[^=≈≅~<>]*[=≈≅~] ?/, '')
    .replace(SEXAGESIMAL, inDegrees)
    .match(QUANTITY);
  if (!found) return null;
  const [, sign, number, denominator = 1, exponent = 0, name] = found;
  const value = Number(`${sign}${decimal(number)}e${exponent}`) / denominator;
  const factor = name ? conversionFactor(table, name, unit) : 1;
  const isNumber = factor !== null && Number.isFinite(value);
  return isNumber && Math.abs(value * factor) !== Infinity ? value * factor : null;
}

/** Return the size of a unit in another one; null if it is unknown, NaN of another dimension. */
function conversionFactor(table, name, unit) {
  table.exact ??= unitsOfTable(table);
  table.folded ??= new Map([...table.exact].map(([key, size]) => [foldedText(key), size]));
  const asked = readUnit(table, table.exact, unit === '1' ? '' : tidyText(unit));
  const plain = tidyText(name).replace(/^1 ?(?=\/)|(?<=[A-Za-z])\.$/g, '');
  let folded = foldedText(plain);
  for (const [word, sign] of Object.entries(table.words)) folded = folded.replaceAll(word, sign);
  const readings = [
    readUnit(table, table.exact, plain),
    readUnit(table, table.folded, folded),
  ].filter(Boolean);
  const fitting = readings.find(({ dimension }) => dimension === asked?.dimension);
  if (fitting) return fitting.size / asked.size;
  return readings.length ? NaN : null;
}

/** Return a text with plain signs and spaces, and powers after carets. */
function tidyText(text) {
  return text
    .replace(/[\u00ad\u200b-\u200f\u2060\ufeff]/g, '')
    .replace(/[−–]/g, '-')
    .replace(/[’′]/g, "'")
    .replace(/[”″]|''/g, '"')
    .replace(
      /[⁺⁻]?[⁰¹²³⁴⁵⁶⁷⁸⁹]+/g,
      (power) => `^${Array.from(power, (c) => '0123456789+-'[EXPONENTS.indexOf(c)]).join('')}`,
    )
    .replace(/[\s\x1c-\x1f\x85]+/g, ' ')
    .trim();
}

/** Return a text without accents, in small letters. */
function foldedText(text) {
  return text.toLowerCase().normalize('NFD').replace(/\p{M}/gu, '');
}

function unitsOfTable(table) {
  const units = new Map();
  const add = (names, unit) => names.split(' ').forEach((name) => units.set(name, unit));
  for (const [names, dimension] of Object.entries(table.base)) add(names, { size: 1, dimension });
  for (const [names, definition] of Object.entries(table.units)) {
    const [factor, ...name] = String(definition).split(' ');
    const unit = readUnit(table, units, name.join(' '));
    add(names, { ...unit, size: Number(factor) * unit.size });
  }
  return units;
}

/** Return a product of units; null where it is none. */
function readUnit(table, units, text) {
  let size = 1;
  let dimension = 0;
  // Of the product, and of each open parenthesis.
  const signs = [1];
  UNIT_FACTOR.lastIndex = 0;
  while (UNIT_FACTOR.lastIndex < text.length) {
    const found = UNIT_FACTOR.exec(text);
    if (!found) return null;
    const [, operator, opened, name, power = '1', symbol, closed] = found;
    const unit = unitOf(table, units, name ?? symbol);
    const sign = operator === '/' ? -signs.at(-1) : signs.at(-1);
    signs.push(...Array(opened.length).fill(sign));
    if (!unit || closed.length >= signs.length) return null;
    const exponent = sign * Number(power.replace(/[()]/g, ''));
    size *= unit.size ** exponent;
    dimension += exponent * unit.dimension;
    signs.length -= closed.length;
  }
  return signs.length === 1 ? { size, dimension } : null;
}

/** Return the unit of a name, or of a prefix and a name. */
function unitOf({ prefixes }, units, name) {
  for (const [prefix, factor] of Object.entries(prefixes)) {
    const unit = name.startsWith(prefix) && units.get(name.slice(prefix.length));
    if (unit) return { ...unit, size: factor * unit.size };
  }
  return null;
}

/** Return degrees, minutes and seconds as decimal degrees. */
function inDegrees(_, ...found) {
  const parts = found.slice(0, 3).map((part = '0') => Number(part.replace(',', '.')));
  return `${parts[0] + parts[1] / 60 + parts[2] / 3600} deg`;
}

/** Return a number with a decimal point and without the separators of thousands. */
function decimal(number) {
  if (!/[., ].*[., ]| /.test(number)) return number.replace(',', '.');
  const [, whole = 'x', , part = ''] = number.match(GROUPED) ?? [];
  return whole.replace(/[., ]/g, '') + part.replace(',', '.');
}
