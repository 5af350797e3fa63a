'use strict';
/* Answers as students write them, and their marks: klann_ros/exercises/marking.py. */

const CLOSE = 0.25;
const MAX_ROUNDING = 0.03;
const ROUNDING_REACH = 2;
/** Return an answer as a number in the unit asked for, or a word; null, NaN: readQuantity. */
function readAnswer(data, text, question) {
  if (question.choices.length) return choiceOf(data, text, question);
  return readQuantity(data.unitTable, text, question.unit);
}

/** Return the choice that a text names, with or without words that mean nothing beside it. */
function choiceOf({ texts, marking, unitTable }, text, { choices }) {
  const plain = (word) =>
    tidyText(unitTable, word)
      .replace(/[^a-z0-9']+/g, ' ')
      .replace(/'/g, '')
      .trim();
  const answer = text.length <= MAX_QUANTITY ? plain(text) : '';
  const fillers = marking.fillers.split(' ');
  const short = answer.split(' ').filter((word) => !fillers.includes(word));
  const namesOf = (choice) =>
    [choice, ...Object.values(texts.choices[choice] ?? {}), ...marking.synonyms[choice]].map(
      (name) => plain(String(name)),
    );
  for (const name of [answer, short.join(' ')])
    for (const choice of choices) if (namesOf(choice).includes(name)) return choice;
  return null;
}

/** Return the marks of answers {question: text}: [{question, points, slip, isCarried}]. */
function markAnswers(exercise, answers) {
  const { kind, data } = exercise;
  const credit = (slip) => data.marking.credit[slip] ?? data.marking.credit.other;
  const textOf = ({ name }) => answers[name] ?? '';
  const read = new Map(kind.questions.map((each) => [each, readAnswer(data, textOf(each), each)]));
  const isNumber = (each) => read.get(each) !== null && !Number.isNaN(read.get(each));
  const isWrong = (each) => isNumber(each) && !exercise.isRight(each, read.get(each));
  const fitting = new Map(
    kind.questions
      .filter(isWrong)
      .map((each) => [each, fittingOf(exercise, each, read.get(each))]),
  );
  const weights = {};
  // A word is easily a mistake's by chance.
  const isQuantity = (each) => typeof read.get(each) === 'number';
  for (const [each, mistakes] of fitting)
    for (const mistake of mistakes.keys())
      weights[mistake] = (weights[mistake] ?? 0) + isQuantity(each);
  const isProven = (mistake) => {
    const changed = kind.questions.filter(
      (each) => isQuantity(each) && each.name in exercise.mistaken.get(mistake),
    );
    const isMost = weights[mistake] > 1 && 2 * weights[mistake] > changed.length;
    return isMost || changesOnlyACount(exercise, mistake);
  };
  const proven = new Set(Object.keys(weights).filter(isProven));
  const marks = kind.questions.map((each) => {
    const answer = read.get(each);
    let slip = 'right';
    if (answer === null) slip = textOf(each).trim() ? 'unreadable' : 'empty';
    else if (Number.isNaN(answer)) slip = 'dimension';
    if (!fitting.has(each)) return { question: each.name, slip, points: credit(slip) };
    const [[mistake] = ['wrong']] = [...fitting.get(each)].sort(
      ([a, gap], [b, other]) =>
        proven.has(b) - proven.has(a) || weights[b] - weights[a] || gap - other,
    );
    const explained = explainedBy(exercise, each, answer, mistake, proven.has(mistake));
    return {
      question: each.name,
      slip: explained.slip,
      points: explained.isCredited * credit(explained.slip),
    };
  });
  return marks.map((mark) => {
    const sources = data.sources[kind.name][mark.question] ?? [];
    const isSource = ({ question, slip }) => slip === mark.slip && sources.includes(question);
    const isCarried = mark.points > 0 && mark.slip !== 'right' && marks.some(isSource);
    return {
      ...mark,
      isCarried,
      points: isCarried ? Math.max(mark.points, credit('carried')) : mark.points,
    };
  });
}

/** Return whether a mistake shows in a count alone: else a count is one by chance. */
function changesOnlyACount({ kind, mistaken }, mistake) {
  const changed = mistaken.get(mistake) ?? {};
  const units = kind.questions.filter(({ name }) => name in changed).map(({ unit }) => unit);
  return units.length === 1 && units[0] === 'count';
}

/** Return the slip that explains a wrong answer, and whether it has points. */
function explainedBy(exercise, question, answer, mistake, isProven) {
  const right = exercise.answers[question.name];
  const size = typeof right === 'string' ? 0 : Math.abs(right);
  const gap = size ? difference(question, answer, right) : 1;
  const [name] = mistake.split(':');
  let isRounded = false;
  if (question.unit !== 'count' && gap <= MAX_ROUNDING * size) {
    const errors = exercise.dithered.map((each) =>
      difference(question, each[question.name], right),
    );
    isRounded =
      name === 'rounding' ||
      gap <= (ROUNDING_REACH * Math.hypot(...errors)) / Math.sqrt(errors.length || 1);
  }
  const slip = name === 'wrong' && isRounded ? 'rounding' : name;
  const isFar =
    question.unit === 'count'
      ? changesOnlyACount(exercise, mistake)
      : size > 0 && gap >= CLOSE * size;
  const isCredited = isProven || isRounded || isFar;
  return { slip: ['f', 'phi'].includes(slip) ? 'sign' : slip, isCredited };
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
