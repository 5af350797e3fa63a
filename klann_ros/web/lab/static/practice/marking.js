'use strict';
/* Answers as students write them, and their marks: klann_ros/exercises/marking.py. */

const ROUNDING_REACH = 30;
/** Return an answer as a number in the unit asked for, or a word; null, NaN: readQuantity. */
function readAnswer(data, text, question) {
  if (question.choices.length) return choiceOf(data, text, question);
  return readQuantity(data.unitTable, text, question.unit);
}

/** Return the choice that a text names, with or without words that mean nothing beside it. */
function choiceOf({ texts, marking }, text, { choices }) {
  const plain = (word) =>
    foldedText(word)
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
  const credit = data.marking.credit;
  const read = new Map(
    kind.questions.map((each) => [each, readAnswer(data, answers[each.name] ?? '', each)]),
  );
  const isWrong = (each) => {
    const answer = read.get(each);
    return answer !== null && !Number.isNaN(answer) && !exercise.isRight(each, answer);
  };
  const fitting = new Map(
    kind.questions
      .filter(isWrong)
      .map((each) => [each, fittingOf(exercise, each, read.get(each))]),
  );
  const weights = {};
  for (const mistake of [...fitting.values()].flatMap((each) => [...each.keys()]))
    weights[mistake] = (weights[mistake] ?? 0) + 1;
  const marks = [];
  for (const each of kind.questions) {
    const mark = { question: each.name, slip: 'empty', isCarried: false };
    if ((answers[each.name] ?? '').trim()) mark.slip = 'unreadable';
    if (read.get(each) !== null) mark.slip = Number.isNaN(read.get(each)) ? 'dimension' : 'right';
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
