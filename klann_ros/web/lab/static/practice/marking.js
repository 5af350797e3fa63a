'use strict';
/* Answers as students write them, and their marks: klann_ros/exercises/marking.py. */

const ROUNDING_REACH = 30;
const MAX_ANSWER = 64;
const NUMBER =
  /^([+-]?) ?((?:\d(?:[\d.,]| (?=\d{3}(?!\d)))*|[.,]\d+)) ?(?:\/ ?(\d+) ?)?(?:(?:e|[x*·×] ?10 ?(?:\^|\*\*)?) ?\(?([+-]?\d{1,3})\)?)? ?(.*)$/;
const GROUPED = /^([1-9]\d{0,2}([ .,])\d{3}(?:\2\d{3})*)(?:(?!\2)([.,]\d*))?$/;
const SEXAGESIMAL =
  /(\d+) ?[°º] ?([0-5]?\d(?:[.,]\d+)?) ?'(?: ?([0-5]?\d(?:[.,]\d+)?) ?(?:"|''))?/;
const EXPONENTS = '⁰¹²³⁴⁵⁶⁷⁸⁹⁻';

/** Return an answer as a number in the unit asked for, or a word; null where it is neither. */
function readAnswer(data, text, question) {
  const plain = text
    .replace(/10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)/g, (_, power) =>
      `10^${Array.from(power, (c) => '0123456789-'[EXPONENTS.indexOf(c)]).join('')}`)
    .replace(/[−–]/g, '-')
    .replace(/[’′]/g, "'")
    .replace(/[”″]/g, '"')
    .trim()
    .replace(/\s+/g, ' ');
  if (!plain || plain.length > MAX_ANSWER) return null;
  if (question.choices.length) return choiceOf(data, plain, question);
  const found = plain.toLowerCase().replace(SEXAGESIMAL, inDegrees).match(NUMBER);
  if (!found) return null;
  const [, sign, number, denominator = 1, exponent = 0, unit] = found;
  const size = Number(`${sign}${decimal(number)}e${exponent}`) / denominator;
  const value = size * factorOf(data.marking, unit, question.unit);
  return Number.isFinite(value) ? value : null;
}

function factorOf({ spellings, factors }, unit, asked) {
  const plain = (spellings[unit] ?? unit).replace(/[°º]/g, 'deg').trim();
  return plain ? (factors[asked]?.[plain] ?? NaN) : 1;
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

function choiceOf({ texts }, text, { choices }) {
  const plain = (word) =>
    word.toLowerCase().normalize('NFD').replace(/-/g, ' ').replace(/\p{M}/gu, '');
  const folded = plain(text).replace(/^classe? /, '');
  const found = choices.findIndex((choice, n) => {
    const words = texts.choices[choice];
    const names = [choice, ...Object.values(words ?? {})].map(plain);
    return names.includes(folded) || (!words && folded === String(n + 1));
  });
  return found < 0 ? null : choices[found];
}

/** Return the marks of answers {question: text}: [{question, points, slip, isCarried}]. */
function markAnswers(exercise, answers) {
  const { kind, data } = exercise;
  const credit = data.marking.credit;
  const read = new Map(
    kind.questions.map((each) => [each, readAnswer(data, answers[each.name] ?? '', each)]),
  );
  const isWrong = (each) => read.get(each) !== null && !exercise.isRight(each, read.get(each));
  const fitting = new Map(
    kind.questions.filter(isWrong).map((each) => [each, fittingOf(exercise, each, read.get(each))]),
  );
  const weights = {};
  for (const mistake of [...fitting.values()].flatMap((each) => [...each.keys()]))
    weights[mistake] = (weights[mistake] ?? 0) + 1;
  const marks = [];
  for (const each of kind.questions) {
    const mark = { question: each.name, slip: 'empty', isCarried: false };
    if ((answers[each.name] ?? '').trim()) mark.slip = 'unreadable';
    if (read.get(each) !== null) mark.slip = 'right';
    if (fitting.has(each)) {
      mark.slip = slipOf(exercise, each, read.get(each), fitting.get(each), weights);
      mark.isCarried = mark.slip !== 'wrong' && marks.some(({ slip }) => slip === mark.slip);
    }
    mark.points = credit[mark.slip] ?? credit.other;
    if (mark.isCarried) mark.points = Math.max(mark.points, credit.carried);
    marks.push(mark);
  }
  return marks;
}

/** Return the mistakes that give an answer, and their distances in thousandths of the last digit. */
function fittingOf(exercise, question, answer) {
  const found = new Map();
  for (const [mistake, wrong] of exercise.mistaken) {
    const value = wrong[question.name];
    if (value === undefined || !exercise.isNear(question, answer, value)) continue;
    const tolerance = exercise.tolerance(question, value);
    const gap = tolerance ? difference(question, answer, value) / tolerance : 0;
    found.set(mistake, Math.round(1e3 * gap));
  }
  return found;
}

function slipOf(exercise, question, answer, fitting, weights) {
  if (fitting.size) {
    const [[mistake]] = [...fitting].sort(
      ([a, gap], [b, other]) => weights[b] - weights[a] || gap - other,
    );
    const [slip] = mistake.split(':');
    return ['f', 'phi'].includes(slip) ? 'sign' : slip;
  }
  const right = exercise.answers[question.name];
  const reach = ROUNDING_REACH * exercise.tolerance(question);
  const isNumber = typeof answer !== 'string' && typeof right !== 'string';
  return isNumber && difference(question, answer, right) <= reach ? 'rounding' : 'wrong';
}
