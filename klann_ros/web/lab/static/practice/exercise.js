'use strict';
/* The exercise of a student, drawn as Python draws it: klann_ros/exercises/variant.py. */

/** Numbers from a text: FNV-1a gives the seed, mulberry32 the numbers. */
class Draw {
  constructor(text) {
    this.state = 0x811c9dc5;
    for (const byte of new TextEncoder().encode(text))
      this.state = Math.imul(this.state ^ byte, 0x01000193) >>> 0;
  }

  unit() {
    this.state = (this.state + 0x6d2b79f5) >>> 0;
    let t = Math.imul(this.state ^ (this.state >>> 15), this.state | 1);
    t = (t + Math.imul(t ^ (t >>> 7), t | 61)) ^ t;
    return ((t ^ (t >>> 14)) >>> 0) / 2 ** 32;
  }

  value(low, high, step = 1) {
    const count = Math.floor((high - low) / step + 1.5);
    return low + step * Math.floor(this.unit() * count);
  }
}

class Kind {
  constructor(data, name) {
    Object.assign(this, { data, name, own: data.kinds[name] });
    this.digits = this.own.digits ?? data.variants.digits;
    this.questions = this.own.asked.split(', ').flatMap((group) => {
      const [unit, ...names] = group.split(' ');
      return names.map((each) => ({ name: each, unit, choices: data.choices[each] ?? [] }));
    });
    const unknowns = [...(data.systems[this.own.system]?.f.keys() ?? [])];
    this.mistakes = [
      ...unknowns.map((row) => `f:${row}`),
      ...unknowns.flatMap((row) => unknowns.map((column) => `phi:${row},${column}`)),
      ...data.mistakes.calculation.trim().split(/\s+/),
    ];
  }

  /** Return givens, in mm, deg, s and N. */
  draw(draw) {
    const givens = {};
    for (const part of this.own.given) {
      const ranges = typeof part === 'string' ? this.data.groups[part] : part;
      for (const [name, [low, high, step]] of Object.entries(ranges))
        givens[name] = draw.value(low, high, step);
    }
    if (this.own.guess) this.addGuess(this.data.systems[this.own.guess], draw, givens);
    const share = this.own['change-points'];
    if (share && draw.unit() < share) {
      const [s, p, q, l] = Object.values(givens).sort((a, b) => a - b);
      givens[Object.keys(givens).find((name) => givens[name] === l)] = p + q - s;
    }
    return givens;
  }

  /** Add a guess near the root, in multiples of 5 deg. */
  addGuess(system, draw, givens) {
    const position = attempted(() => new Calculation(this.data, givens).work(system.position));
    for (const name of system.unknowns.split(' ')) {
      const fifths = (position?.answers[name] ?? 0) / 5;
      const isTie = Math.abs(fifths % 1) === 0.5;
      const near = isTie ? 2 * Math.round(fifths / 2) : Math.round(fifths);
      givens[`${name}_1`] = 5 * near + 5 * draw.value(-3, 3);
    }
  }

  /** Return the calculation with a mistake; null where it leads nowhere. */
  calculated(givens, mistake = '') {
    const calculation = new Calculation(this.data, givens, mistake, this.own.input ?? '');
    return attempted(() => calculation.work(this.name));
  }
}

class Exercise {
  constructor(data, name, student) {
    Object.assign(this, { data, student, kind: new Kind(data, name) });
    const draw = new Draw(`${name}:${student}`);
    for (let n = 0; n < data.variants.draws; n += 1) {
      this.givens = this.kind.draw(draw);
      if (this.isSuitable()) return;
    }
    throw new Error(`${name}: no suitable numbers`);
  }

  /** Return whether the givens assemble, are well conditioned and have fair answers. */
  isSuitable() {
    this.worked = this.kind.calculated(this.givens);
    const { smallest, guard } = this.data.variants;
    const guarded = this.worked && this.kind.calculated(this.givens, guard.mistake);
    if (!guarded) return false;
    this.answers = this.worked.answers;
    return this.kind.questions.every((question) => {
      const [right, rounded] = [this.answers[question.name], guarded.answers[question.name]];
      if (typeof right === 'string') return right === rounded;
      const isFair = Math.abs(right) >= smallest[question.unit];
      return (
        isFair && difference(question, rounded, right) <= guard.share * this.tolerance(question)
      );
    });
  }

  /** Return a unit of the last digit asked for, of the right answer or of a value. */
  tolerance({ name, unit }, value = this.answers[name]) {
    if (typeof value === 'string' || unit === 'count') return 0;
    const size = Math.max(Math.abs(value), this.data.variants.smallest[unit]);
    return Number(`1e${orderOf(size) + 1 - this.kind.digits}`);
  }

  isNear(question, answer, value) {
    if (typeof answer === 'string' || typeof value === 'string') return answer === value;
    return difference(question, answer, value) <= this.tolerance(question, value) * (1 + 1e-6);
  }

  isRight(question, answer) {
    return this.isNear(question, answer, this.answers[question.name]);
  }

  /** Return the wrong answers of each mistake, by question. */
  get mistaken() {
    this.wrong ??= this.allMistaken();
    return this.wrong;
  }

  /** Return the answers with errors as of three digits in all intermediate results. */
  get dithered() {
    this.rough ??= Array.from({ length: this.data.marking['dither-series'] }, (_, k) =>
      this.kind.calculated(this.givens, `dither:${k + 1}`),
    )
      .filter(Boolean)
      .map(({ answers }) => answers);
    return this.rough;
  }

  allMistaken() {
    const found = new Map();
    for (const mistake of this.kind.mistakes) {
      const calculation = this.kind.calculated(this.givens, mistake);
      if (calculation) found.set(mistake, this.wrongOf(calculation.answers));
    }
    for (const { name, unit } of this.kind.questions) {
      const right = this.answers[name];
      if (typeof right === 'string') continue;
      const changes = Object.entries(this.data.mistakes.answers[unit] ?? {});
      for (const [mistake, [factor, summand]] of changes) {
        const wrong = this.wrongOf({ [name]: factor * right + summand });
        found.set(mistake, { ...found.get(mistake), ...wrong });
      }
    }
    return found;
  }

  wrongOf(answers) {
    const isWrong = (question) => {
      const answer = answers[question.name];
      // An angle beyond any unit's mistake diverged.
      const limit = question.unit === 'deg' ? 60 * 360 : Infinity;
      const isAnswer = typeof answer === 'string' || Math.abs(answer) < limit;
      return isAnswer && !this.isRight(question, answer);
    };
    const wrong = this.kind.questions.filter(isWrong);
    return Object.fromEntries(wrong.map(({ name }) => [name, answers[name]]));
  }
}

/** Return the distance of two answers, of angles modulo a turn. */
function difference({ unit }, answer, value) {
  const gap = Math.abs(answer - value);
  return unit === 'deg' ? Math.min(gap % 360, 360 - (gap % 360)) : gap;
}

/** Return the exponent of a number's first digit. */
function orderOf(value) {
  return Number(value.toExponential().split('e')[1]);
}
