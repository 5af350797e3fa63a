'use strict';
/* The textbook's Newton-Raphson from a guess: its iterates in a table, one of them in the drawing. */

const MOST_CORRECTIONS = 50;
const GREEK = { alpha: 'α', beta: 'β', gamma: 'γ', delta: 'δ', theta: 'θ' };

class NewtonPanel {
  constructor(lab, scene) {
    this.lab = lab;
    this.scene = scene;
    this.drawn = 0;
    lab.on('linkage', () => this.build());
    lab.on('guess', () => this.showGuess());
    for (const event of ['pose', 'numbers']) lab.on(event, () => this.soon());
    byId('rounded').addEventListener('change', () => this.run());
    byId('iterate').addEventListener('change', () => this.draw(Number(byId('iterate').value)));
    byId('random').addEventListener('click', () => this.guessAtRandom());
    byId('from-pose').addEventListener('click', () =>
      lab.setGuess((lab.pose.x || lab.lastGood.x).slice(1)),
    );
    byId('lecture').addEventListener('click', () => this.showExample('klann'));
    byId('four-bar-lecture').addEventListener('click', () => this.showExample('four_bar'));
  }

  /** Return how the lecture of this linkage works, if it is wished and there is one. */
  get way() {
    return byId('rounded').checked && this.course ? COURSES[this.course] : NO_COURSE;
  }

  get bodies() {
    return this.lab.linkage.structure.bodies.slice(1);
  }

  build() {
    this.course = courseOf(this.lab.linkage, this.lab.isKlann);
    byId('rounded').parentNode.hidden = !this.course;
    if (this.course) byId('rounded-text').textContent = say(this.course);
    this.fields = this.bodies.map((body, i) => this.field(body, i));
    byId('guess').replaceChildren(...this.fields.map(({ input }) => input.parentNode.parentNode));
    this.drawn = 0;
    this.showGuess();
  }

  field(body, i) {
    const scale = body.slides ? 1000 : 360 / TAU;
    const field = new DecimalField(this.lab, {
      digits: 7,
      unit: body.slides ? 'mm' : '°',
      value: () => this.lab.guess[i] * scale,
      take: (shown) => this.lab.setGuess(this.lab.guess.with(i, shown / scale)),
    });
    const label = made('label', '', say('guess', body.name, body.slides ? 'mm' : '°'));
    const node = made('div');
    label.append(field.input);
    node.append(label, field.reason);
    return field;
  }

  showGuess() {
    for (const field of this.fields) field.show();
    this.run();
  }

  guessAtRandom() {
    const { size } = this.lab.linkage;
    this.lab.setGuess(
      this.bodies.map((body) => (2 * Math.random() - 1) * (body.slides ? size : Math.PI)),
    );
  }

  /** Show a lecture's example: its file starts from the guess at the lecture's crank angle. */
  showExample(name) {
    this.lab.attempt(() => {
      byId('rounded').checked = true;
      this.lab.choose(name);
    });
  }

  /** Iterate again when the crank rests. */
  soon() {
    clearTimeout(this.waiting);
    this.waiting = setTimeout(() => this.run(), 40);
  }

  run() {
    clearTimeout(this.waiting);
    const { linkage, alpha, guess } = this.lab;
    const { tolerance, rounding } = this.way;
    const start = [alpha, ...guess];
    this.found = newtonRaphson(linkage, start, MOST_CORRECTIONS, tolerance, rounding);
    // Where the course slips: in its fourth estimate of its own example [deg].
    const [, , angle] = this.found.x[3] || [];
    const isSlip = Math.abs((angle * 360) / TAU - RIGHT_ESTIMATE) < 1e-9;
    byId('slips').hidden = !isSlip || this.way !== COURSES.fourBar;
    byId('verdict').textContent = this.verdict();
    const options = this.found.x.map((_, k) => new Option(`x${subscript(k + 1)}`, k + 1));
    byId('iterate').replaceChildren(new Option('–', 0), ...options);
    this.table();
    this.draw(Math.min(this.drawn, this.found.x.length));
  }

  verdict() {
    const { linkage, pose, alpha } = this.lab;
    const { x, converged, isSingular } = this.found;
    const count = x.length - 1;
    if (converged) {
      const last = x.at(-1);
      const u = linkage.vectors(last);
      const signs = linkage.blocks.map((block) => (block.sine(u) < 0 ? -1 : 1));
      // With rounded corrections it ends near the root.
      const near = this.way === COURSES.fourBar ? 1e-3 : SAME_POSE;
      const isDrawn = !pose.error && poseDistance(linkage, last, pose.x) < near;
      return say('converged', count, signsText(signs), isDrawn);
    }
    const why = isSingular ? say('singular', count) : say('diverged', count);
    const hasNone = linkage.isDyadic && !dyadPoses(linkage, alpha, 1).length;
    return hasNone ? `${why} ${say('noRoot')}` : why;
  }

  table() {
    const { x, residuals } = this.found;
    const names = this.bodies.map((body) => `${body.name} [${body.slides ? 'mm' : '°'}]`);
    const head = made('tr');
    for (const name of ['k', ...names, say('gap')]) {
      const cell = made('th', '', name);
      cell.scope = 'col';
      head.append(cell);
    }
    const thead = made('thead');
    const body = made('tbody');
    thead.append(head);
    body.append(...x.map((row, k) => this.row(row, k, residuals[k])));
    byId('iterates').replaceChildren(thead, body);
    this.mark();
  }

  row(x, k, residual) {
    const row = made('tr');
    const first = made('th', '', String(k + 1));
    first.scope = 'row';
    const cells = x
      .slice(1)
      .map((value, i) => made('td', '', this.shown(value, this.bodies[i].slides, k)));
    const gap = residual === undefined ? '' : inLocale((1000 * residual).toExponential(2));
    row.append(first, ...cells, made('td', '', gap));
    row.addEventListener('click', () => this.draw(k + 1));
    return row;
  }

  shown(value, slides, k) {
    if (slides) return decimals(1000 * value, 4);
    if (Math.abs(value) > 1e6) return inLocale(value.toExponential(3));
    const { printed, digits } = this.way;
    // The guess is nobody's result.
    const angle = k ? printed(value) : value;
    return decimals((angle * 360) / TAU, digits(k));
  }

  draw(k) {
    this.drawn = k;
    byId('iterate').value = String(k);
    this.scene.iterate = k ? this.found.x[k - 1] : null;
    this.scene.show();
    this.mark();
    this.showStep(Math.max(k, 1) - 1);
  }

  /** Show f, Phi and the correction of a step, in the order, signs and units of the lectures. */
  showStep(k) {
    const { linkage } = this.lab;
    const { f, phi } = linkage.equations(this.found.x[k]);
    // The four-bar course goes round its loop the other way than SEM 104 round both of its.
    const sign = this.course === 'fourBar' ? -1 : 1;
    const shown = (value) => shownTerm(sign * 1000 * value);
    const slides = this.bodies.some((body) => body.slides);
    const mark = subscript(k + 1);
    const group = (label, matrix, unit) => {
      const node = made('div');
      node.append(made('span', '', label), matrix, made('span', '', unit));
      return node;
    };
    const { x: solution } = solved(phi, f);
    byId('step').replaceChildren(
      group(`f(x${mark}) =`, matrixOf(f.map((value) => [shown(value)])), 'mm'),
      group(
        `Φ${mark} =`,
        matrixOf(phi.map((row) => row.map(shown))),
        slides ? 'mm/rad, mm/m' : 'mm',
      ),
    );
    if (solution)
      byId('step').append(
        group(
          `−Φ${mark}⁻¹ f(x${mark}) =`,
          matrixOf(solution.map((value, i) => this.correctionTexts(-value, this.bodies[i], k))),
          '',
        ),
      );
    byId('step-title').textContent = say('step', k + 1, subscript(k + 1), subscript(k + 2));
    byId('equations').replaceChildren(
      ...equationTexts(linkage, sign).map((text) => made('li', '', text)),
    );
  }

  /** Return a correction in rad and degrees, or in mm, with the digits that the lecture keeps. */
  correctionTexts(value, { slides }, k) {
    if (slides) return [`${shownTerm(1000 * value, 6)} mm`, ''];
    const { rounding } = this.way;
    const angle = rounding.correction(value, k);
    const digits = digitsOf(CORRECTION_DIGITS, k);
    const [radians, degrees] = [angle, (angle * 360) / TAU].map((part, n) =>
      rounding === UNROUNDED ? shownTerm(part, 6 - 2 * n) : decimals(part, digits - n),
    );
    return [`${radians} rad`, `${degrees}°`];
  }

  mark() {
    [...byId('iterates').querySelectorAll('tbody tr')].forEach((row, k) =>
      row.classList.toggle('drawn', k + 1 === this.drawn),
    );
  }
}

function subscript(number) {
  return Array.from(String(number), (digit) => '₀₁₂₃₄₅₆₇₈₉'[digit]).join('');
}

/** Return an entry of f or Phi as the lectures print it: 3 decimals, and 3 more of what is small. */
function shownTerm(value, digits = 3) {
  const size = Math.abs(value);
  if (!size) return '0';
  if (size < 5e-7 || size >= 1e7) return inLocale(value.toExponential(2));
  return decimals(value, size < 0.01 ? digits + 3 : digits);
}

function matrixOf(rows) {
  const table = made('table', 'matrix');
  for (const texts of rows) {
    const row = made('tr');
    row.append(...texts.map((text) => made('td', '', text)));
    table.append(row);
  }
  return table;
}

/** Return the loop equations as the lecture writes them; none of bodies that slide or braced bars. */
function equationTexts(linkage, sign) {
  const { structure, numbers } = linkage;
  const bends = new Map();
  for (const [n, { kind, place }] of structure.dimensions.entries()) {
    if (kind === 'brace' || structure.slides) return [];
    if (kind === 'bend') bends.set(place, numbers[n]);
  }
  const term = (times, text) => `${sign * times < 0 ? '\u2212' : '+'} ${text}`;
  const equation = ({ bars, pivots }, axis) => {
    const parts = [...bars].map(([n, times]) => {
      const { body, bar } = structure.bars[n];
      const sense = structure.senses[body];
      const bend = sense * (bends.get(n) || 0);
      // theta2 is a letter and a number.
      const name = structure.angles[body].replace(/^[a-z]+(?=\d*$)/, (word) => GREEK[word] || word);
      const angle = bend
        ? `(${name} ${bend < 0 ? '\u2212' : '+'} ${shownAngle(Math.abs(bend))})`
        : ` ${name}`;
      const isY = axis === 1;
      return term(
        isY ? sense * times : times,
        `L(${bar.from}${bar.to}) ${isY ? say('sine') : 'cos'}${angle}`,
      );
    });
    const ends = [...pivots].flatMap(([place, times]) =>
      times && linkage.pivots[place][axis]
        ? [term(times, `${'xy'[axis]}(${structure.pivots[place]})`)]
        : [],
    );
    return [...parts, ...ends].join(' ').replace(/^\+ /, '');
  };
  return structure.paths.loops.flatMap((path, k) =>
    [0, 1].map((axis) => `f${subscript(2 * k + axis + 1)} = ${equation(path, axis)}`),
  );
}

function shownAngle(angle) {
  return `${inLocale(general((angle * 360) / TAU))}°`;
}
