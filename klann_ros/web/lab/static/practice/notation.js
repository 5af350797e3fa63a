'use strict';
/* Symbols, numbers and formulas as the printed sheet writes them: klann_ros/exercises/sheet.py. */

const SUBSCRIPT = /_(\([^)]*\)|[A-Za-z0-9α-ω]+(?:,[A-Za-z0-9]+)*)/;

const SINES = { sin: 'sen', asin: 'arcsen' };

/** Return a text, whose underscores are subscripts, as nodes. */
function rich(text) {
  const parts = text.replace(/(?<![\p{L}\d_])-/gu, '−').split(SUBSCRIPT);
  return parts.map((part, n) => (n % 2 ? made('sub', '', part.replace(/[()]/g, '')) : part));
}

/** Return the symbol of a quantity, such as 'theta_2', as nodes. */
function symbolOf({ greek, symbols }, name) {
  if (name in symbols) return rich(symbols[name]);
  const [base, ...subs] = name.split('_').map((part) => greek[part] ?? part);
  if (base === '∠') return [base + subs.join('')];
  return [made('i', '', base), ...(subs.length ? [made('sub', '', subs.join())] : [])];
}

/** Return a formula with the sine of the page's language. */
function inLanguage(formula) {
  return language.now === 'pt' ? formula.replace(/\ba?sin\b/g, (name) => SINES[name]) : formula;
}

/** Return a number in the page's language. */
function localised(number) {
  const text = number.replaceAll('-', '−');
  return language.now === 'pt' ? text.replaceAll('.', ',') : text;
}

// Rounding errors, in any unit that is shown.
const ROUNDING_ERROR = 1e-9;

function withUnit({ units }, value, unit) {
  const sign = units[unit] ?? unit;
  const number = localised(general(Math.abs(value) > ROUNDING_ERROR ? value : 0));
  return ['', '°'].includes(sign) ? number + sign : `${number} ${sign}`;
}

/** Return an answer to the digits asked for. */
function answerText(exercise, question, answer) {
  if (typeof answer === 'string') return wordOf(exercise.data, answer);
  const tolerance = exercise.tolerance(question);
  return localised(answer.toFixed(tolerance ? Math.max(0, -Math.floor(Math.log10(tolerance) + 1e-9)) : 0));
}

/** Return a choice in the page's language. */
function wordOf({ texts }, choice) {
  return texts.choices[choice]?.[language.now] ?? choice;
}
