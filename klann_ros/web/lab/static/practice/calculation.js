'use strict';
/* A calculation as a student writes it, or with one mistake: klann_ros/exercises/calculation.py. */

const ROW = /^(\w+)(?: (\S+))? (:?=) (.+?)(?: \| (.*))?$/;
const RESULTS = /^(.+?) (\S+) (:?=) (.*)$/;
const SINGULAR = 1e-12;
const SEARCH_ROUNDS = 36;
const GOLDEN_SHARE = (Math.sqrt(5) - 1) / 2;
const FUNCTIONS = {
  sqrt: (x) => finite(Math.sqrt(x)),
  hypot: Math.hypot,
  min: Math.min,
  max: Math.max,
  abs: Math.abs,
};

class Calculation {
  constructor(data, givens, mistake = '', input = '') {
    Object.assign(this, { data, givens, mistake, input, steps: [], answers: {} });
    [this.slip, this.place = ''] = mistake.split(':');
    this.digits = this.slip === 'rounding' ? Number(this.place) : 0;
    this.series = this.slip === 'dither' ? Number(this.place) : 0;
    this.isRadian = mistake === 'radians:trig';
    this.halfTurn = this.isRadian ? Math.PI : 180;
    const radian = (angle) => finite(this.isRadian ? angle : angle * (Math.PI / 180));
    const angle = (value) => finite(this.isRadian ? value : value * (180 / Math.PI));
    const [cosine, sine] = mistake === 'sine:all' ? [Math.sin, Math.cos] : [Math.cos, Math.sin];
    this.scope = {
      ...FUNCTIONS,
      cos: (value) => this.dithered(cosine(radian(value))),
      sin: (value) => this.dithered(sine(radian(value))),
      acos: (value) => angle(Math.acos(value)),
      atan2: (y, x) => angle(Math.atan2(y, x)),
      sign: (loop) => (this.slip === 'assembly' && this.place.includes(loop) ? -1 : 1),
      wrapped: (value) => this.halfTurn - modulo(this.halfTurn - value, 2 * this.halfTurn),
      half_turn: this.halfTurn,
      ...givens,
    };
    const reading = data.mistakes?.input[mistake];
    if (reading && input in givens) this.scope[input] = reading[0] * givens[input] + reading[1];
  }

  /** Work the formulas of a name; Impossible where they lead nowhere. */
  work(name) {
    for (const row of this.data.formulas[name]) {
      if (typeof row === 'string') this.workRow(row);
      else if ('solve' in row) this.solveSystem(row);
      else if ('sweep' in row) this.sweep(row.sweep, row.extremes);
      else this.newton(row.newton);
    }
    return this;
  }

  workRow(row) {
    const [, word, rest] = row.match(/^(\S+) (.*)$/);
    if (word === 'use') this.work(rest);
    else if (word === 'require') {
      // A wrong calculation goes on, as its student does.
      if (!this.mistake && !this.value(rest)) impossible();
    } else {
      const [, symbol, unit = '', becomes, expression, formula = ''] = row.match(ROW);
      this.record(symbol, unit, becomes, this.value(expression), formula);
    }
  }

  value(text) {
    return expressions(text)(this.scope)[0];
  }

  values(text) {
    return expressions(text)(this.scope);
  }

  record(symbol, unit, becomes, value, formula) {
    const kept = unit && becomes === '=' ? this.rounded(value) : value;
    if (unit) this.steps.push({ symbol, value: kept, unit, formula });
    this.answers[symbol] = this.scope[symbol] = kept;
  }

  solveSystem({ solve, right, gives }) {
    const rows = typeof solve === 'string' ? this.data.systems[solve].phi : solve;
    const found = this.solution(...this.written(rows, right));
    const [, symbols, unit, becomes, formula] = gives.match(RESULTS);
    symbols
      .split(' ')
      .forEach((symbol, n) => this.record(symbol, unit, becomes, found[n], formula));
  }

  /** Return matrix and right side of a linear system as this student writes them. */
  written(rows, right) {
    const [phi, [f]] = [rows, [right]].map((each) => each.map((row) => [...this.values(row)]));
    if (this.slip === 'phi') {
      const [row, column] = this.place.split(',').map(Number);
      phi[row][column] *= -1;
    } else if (this.slip === 'f') f[Number(this.place)] *= -1;
    const own = this.mistake === 'transposed' ? phi.map((_, n) => phi.map((row) => row[n])) : phi;
    return [...own, f].map((row) => row.map((each) => this.rounded(each)));
  }

  /** Return Phi^-1 f, by this student, for the rows of Phi and f. */
  solution(...rows) {
    const solved = solveLinear(rows.slice(0, -1), rows.at(-1));
    return this.mistake === 'sign:step' ? solved.map((each) => -each) : solved;
  }

  newton(name) {
    const system = this.data.systems[name];
    const names = system.unknowns.split(' ');
    const guess = names.map((each) => this.givens[`${each}_1`]);
    const phi = this.linearised(system, names, guess);
    phi.pop().forEach((value, n) => {
      this.record(`f_${n + 1}`, 'mm', ':=', value, `f_${n + 1}(x_1)`);
    });
    phi.forEach((row, n) =>
      row.forEach((value, m) => {
        const shown = `∂f_${n + 1}/∂x_${m + 1} (x_1)`;
        this.record(`Phi_${n + 1}${m + 1}`, 'mm', '=', value, shown);
      }),
    );
    const { x, count } = this.iterates(system, names, guess);
    const { fewest, fair, stop, lost } = this.data.iterations;
    const isLost = x.at(-1).some((each, n) => Math.abs(each - x.at(-2)[n]) > lost);
    const last =
      x[this.slip === 'short' ? Math.min(Number(this.place), x.length - 1) : x.length - 1];
    const second = this.mistake === 'short:1' ? x[0] : x[1];
    names.forEach((each, n) => {
      this.answers[`${each}_2`] = second[n];
      this.answers[each] = isLost ? NaN : last[n];
    });
    this.answers.iterations = count;
    if (this.mistake && this.slip !== 'assembly') return;
    const closed = new Calculation(this.data, this.givens, this.mistake, this.input);
    const { answers } = closed.work(system.position);
    // The root of the assembly mode that is drawn, in a fair number of iterations.
    const isDrawn = names.every((each) => Math.abs(answers[each] - this.answers[each]) <= stop);
    if (!this.mistake && !(isDrawn && fewest <= count && count <= fair)) impossible();
    for (const each of names) this.answers[each] = answers[each];
  }

  linearised(system, names, x) {
    names.forEach((each, n) => {
      this.scope[each] = x[n];
    });
    return this.written(system.phi, system.f.join());
  }

  iterates(system, names, guess) {
    const { most, stop, converged } = this.data.iterations;
    const x = [guess];
    let count = 0;
    while (x.length <= most) {
      const at = x.at(-1);
      let correction = this.solution(...this.linearised(system, names, at));
      if (this.mistake !== 'radians:step' && !this.isRadian)
        correction = correction.map((each) => each * (180 / Math.PI));
      x.push(at.map((each, n) => this.rounded(each - correction[n])));
      names.forEach((each, n) => {
        this.record(`${each}_${x.length}`, 'deg', '=', x.at(-1)[n], 'x_(k+1) = x_k - Φ⁻¹ f');
      });
      const largest = Math.max(...correction.map(Math.abs));
      count ||= largest <= stop ? x.length - 1 : 0;
      if (largest <= converged) break;
    }
    return { x, count };
  }

  /** Answer with the differences of extremes over a turn of the input angle. */
  sweep(formulas, extremes) {
    const at = (angle) => {
      const givens = { ...this.givens, [this.input]: angle };
      return new Calculation(this.data, givens, this.mistake, this.input).work(formulas).scope;
    };
    const { step, printed } = this.data.table;
    const table = [];
    for (let angle = 0; angle < 360; angle += step) table.push([angle, at(angle)]);
    for (const [angle, scope] of table)
      if (angle % printed === 0)
        for (const name of Object.values(extremes))
          this.record(name, 'mm', '=', scope[name], `α = ${angle}°`);
    for (const [answer, name] of Object.entries(extremes)) {
      const ends = [1, -1].map((sense) => {
        const most = Math.max(...table.map(([, scope]) => sense * scope[name]));
        const [near] = table.find(([, scope]) => sense * scope[name] === most);
        return greatest((angle) => sense * at(angle)[name], near - step, near + step);
      });
      this.record(answer, 'mm', ':=', ends[0] + ends[1], `max ${name} - min ${name}`);
    }
  }

  rounded(value) {
    // Without the last bits of a tie.
    return this.digits ? significant(significant(value, 12), this.digits) : this.dithered(value);
  }

  /** Return a number with an error below half its third digit, by its size and a series. */
  dithered(value) {
    if (!this.series || !value) return value;
    const second = 10 ** (orderOf(Math.abs(value)) - 1);
    return value + 0.05 * second * Math.sin((this.series * value) / second);
  }
}

/** Return a value modulo a positive one, as Python does. */
function modulo(value, by) {
  const rest = value % by;
  return rest < 0 ? rest + by : rest;
}

/** Return the greatest value of a function between two angles, by golden section. */
function greatest(value, ...ends) {
  let [low, high] = ends;
  let values;
  for (let round = 0; round < SEARCH_ROUNDS; round += 1) {
    const left = high - GOLDEN_SHARE * (high - low);
    const right = low + GOLDEN_SHARE * (high - low);
    values = [value(left), value(right)];
    [low, high] = values[0] < values[1] ? [left, high] : [low, right];
  }
  return Math.max(...values);
}

/** Return the solution of linear equations, by elimination with the largest pivot of a column. */
function solveLinear(matrix, right) {
  const rows = matrix.map((row, n) => [...row, right[n]]);
  // The determinant over the lengths of the rows.
  let determinant = matrix.reduce((product, row) => product / Math.hypot(...row), 1);
  rows.forEach((_, n) => {
    const size = (row) => Math.abs(row[n]);
    const pivot = rows.slice(n).reduce((best, row) => (size(row) > size(best) ? row : best));
    determinant *= size(pivot);
    if (!(determinant > 0)) impossible();
    rows[rows.indexOf(pivot)] = rows[n];
    rows[n] = pivot;
    for (const row of rows.slice(n + 1)) {
      const factor = row[n] / pivot[n];
      for (let m = n; m < row.length; m += 1) row[m] -= factor * pivot[m];
    }
  });
  if (!(determinant > SINGULAR)) impossible();
  const x = [];
  for (let n = rows.length - 1; n >= 0; n -= 1) {
    const known = x.reduce((sum, each, m) => sum + rows[n][rows.length - 1 - m] * each, 0);
    x.push((rows[n].at(-1) - known) / rows[n][n]);
  }
  return x.reverse();
}

/** Return a value rounded to significant digits; half goes to the even digit, as in Python. */
function significant(value, digits) {
  if (value === 0 || !Number.isFinite(value)) return value;
  const exact = value.toExponential(60);
  const [mantissa, exponent] = exact.split('e');
  const sign = value < 0 ? 1 : 0;
  const kept = mantissa.slice(0, digits + sign + (digits > 1 ? 1 : 0));
  const dropped = mantissa.slice(kept.length).replace('.', '');
  const isTie = /^50*$/.test(dropped) && '02468'.includes(kept.at(-1));
  return Number(isTie ? `${kept}e${exponent}` : value.toExponential(digits - 1));
}
