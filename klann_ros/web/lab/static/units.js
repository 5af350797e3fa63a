'use strict';
/* Quantities as people write them: klann_ros/sanitize/quantity.py; a table is units.yaml. */

const MAX_QUANTITY = 64;

/**
 * Return the number of a text in a unit, by the table of units; null where it is none, NaN where
 * its own unit is of another dimension.
 */
function readQuantity(table, text, unit) {
  const { quantity, arc, grouped } = table.patterns;
  const plain = text.length <= 4 * MAX_QUANTITY ? tidyText(table, text) : '';
  const found = wholeMatch(quantity, plain.replace(new RegExp(arc, 'g'), inDegrees));
  if ([...plain].length > MAX_QUANTITY || !found) return null;
  const [, sign, number, pi = '', denominator = 1, exponent = 0, unitName] = found;
  const name = `${pi} ${unitName}`.trim();
  const [, whole, , part = ''] = wholeMatch(grouped, number) ?? [];
  const digits = whole ? whole.replace(/[., ]/g, '') + part : number;
  const value = Number(`${sign}${digits.replaceAll(',', '.') || 1}e${exponent}`) / denominator;
  const factor = name ? conversionFactor(table, name, unit) : 1;
  const isNumber = factor !== null && Number.isFinite(value);
  return isNumber && Math.abs(value * factor) !== Infinity ? value * factor : null;
}

/** Return the size of a unit in another one; null if it is unknown, NaN of another dimension. */
function conversionFactor(table, name, unit) {
  table.sizes ??= unitsOfTable(table);
  const asked = readUnit(table, table.sizes, tidyText(table, unit));
  const reading = readUnit(table, table.sizes, tidyText(table, name));
  if (!reading || !asked) return null;
  return reading.dimension === asked.dimension ? reading.size / asked.size : NaN;
}

/** Return a text in small letters, with plain signs and spaces, and powers after carets. */
function tidyText({ tidy }, text) {
  // Mega, before its letter is small.
  const letters = text
    .replace(/M(?=[NWJ])/g, 'mega')
    .toLowerCase()
    .normalize('NFD');
  const replaced = (plain, [pattern, replacement]) =>
    plain.replace(new RegExp(pattern, 'g'), replacement);
  return Object.entries(tidy).reduce(replaced, letters).trim();
}

function wholeMatch(pattern, text) {
  return text.match(new RegExp(`^(?:${pattern})$`));
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
  const pattern = new RegExp(table.patterns.factor, 'y');
  while (pattern.lastIndex < text.length) {
    const found = pattern.exec(text);
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
