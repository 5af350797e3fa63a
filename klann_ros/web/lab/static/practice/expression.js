'use strict';
/*
 * Expressions of exercises.yaml, such as `sqrt(L_1**2 + L_2**2) if L_1 > L_2 else 0`, which Python
 * evaluates itself: numbers, words, names, calls, arithmetic, comparisons, and, or, if ... else.
 */

/** A calculation that leads nowhere, as an arc cosine beyond 1. */
class Impossible extends Error {}

const TOKEN = /\s*(\d+(?:\.\d+)?|\w+|'[^']*'|\*\*|[<>=]=|[-+*/(),<>])/y;
const OPERATORS = {
  '+': (a, b) => a + b,
  '-': (a, b) => a - b,
  '*': (a, b) => a * b,
  '/': (a, b) => a / (b || impossible()),
  '**': (a, b) => finite(a ** b),
  '<': (a, b) => a < b,
  '>': (a, b) => a > b,
  '<=': (a, b) => a <= b,
  '>=': (a, b) => a >= b,
  '==': (a, b) => a === b,
  and: (a, b) => a && b,
  or: (a, b) => a || b,
};
// From the loosest to the tightest; powers are read with their sign.
const LEVELS = [['or'], ['and'], ['<', '>', '<=', '>=', '=='], ['+', '-'], ['*', '/']];
const read = new Map();

function impossible() {
  throw new Impossible();
}

function finite(number) {
  return Number.isFinite(number) ? number : impossible();
}

/** Return what a calculation gives; null where it leads nowhere. */
function attempted(calculate) {
  try {
    return calculate();
  } catch (error) {
    if (error instanceof Impossible) return null;
    throw error;
  }
}

/** Return the function of a scope that a list of expressions is; each is read once. */
function expressions(text) {
  if (!read.has(text)) read.set(text, new Expression(text).list());
  return read.get(text);
}

class Expression {
  constructor(text) {
    TOKEN.lastIndex = 0;
    this.tokens = [];
    for (let found = TOKEN.exec(text); found; found = TOKEN.exec(text)) this.tokens.push(found[1]);
    if (this.tokens.join('') !== text.replace(/\s(?=(?:[^']*'[^']*')*[^']*$)/g, ''))
      throw new SyntaxError(text);
  }

  take(token) {
    const isNext = this.tokens[0] === token;
    if (isNext) this.tokens.shift();
    return isNext;
  }

  list() {
    const all = [this.choice()];
    while (this.take(',')) all.push(this.choice());
    return (scope) => all.map((each) => each(scope));
  }

  choice() {
    const then = this.level(0);
    if (!this.take('if')) return then;
    const condition = this.level(0);
    this.take('else');
    const otherwise = this.choice();
    return (scope) => (condition(scope) ? then(scope) : otherwise(scope));
  }

  level(depth) {
    if (depth === LEVELS.length) return this.signed();
    let left = this.level(depth + 1);
    while (LEVELS[depth].includes(this.tokens[0])) {
      const [operate, first] = [OPERATORS[this.tokens.shift()], left];
      const second = this.level(depth + 1);
      left = (scope) => operate(first(scope), second(scope));
    }
    return left;
  }

  signed() {
    if (this.take('-')) {
      const value = this.signed();
      return (scope) => -value(scope);
    }
    const base = this.atom();
    if (!this.take('**')) return base;
    const exponent = this.signed();
    return (scope) => OPERATORS['**'](base(scope), exponent(scope));
  }

  atom() {
    const token = this.tokens.shift();
    if (token === '(') {
      const inner = this.choice();
      this.take(')');
      return inner;
    }
    if (/^[\d']/.test(token)) {
      const value = token[0] === "'" ? token.slice(1, -1) : Number(token);
      return () => value;
    }
    if (!this.take('(')) return (scope) => scope[token];
    const values = this.list();
    this.take(')');
    return (scope) => scope[token](...values(scope));
  }
}
