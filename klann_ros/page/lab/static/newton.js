'use strict';
/* The textbook's Newton-Raphson from a guess: its iterates in a table, one of them in the drawing. */

const MOST_CORRECTIONS = 50;
const NEWTON_TOLERANCE = 1e-12;
// The lecture's example: the crank's angle, then gamma, beta, delta, theta [deg].
const EXAMPLE = [60, 15, 60, 45, 60];
// What it prints is rounded in radians, before it is told in degrees.
const PRINTED = 1e4;

class NewtonPanel {
  constructor(lab, scene) {
    this.lab = lab;
    this.scene = scene;
    this.drawn = 0;
    lab.on('linkage', () => this.build());
    for (const event of ['pose', 'numbers']) lab.on(event, () => this.soon());
    byId('rounded').addEventListener('change', () => this.table());
    byId('iterate').addEventListener('change', () => this.draw(Number(byId('iterate').value)));
    byId('random').addEventListener('click', () => this.guessAtRandom());
    byId('from-pose').addEventListener('click', () =>
      this.take((lab.pose.x || lab.lastGood.x).slice(1)),
    );
    byId('lecture').addEventListener('click', () => this.showExample());
  }

  get bodies() {
    return this.lab.linkage.structure.bodies.slice(1);
  }

  build() {
    const { start } = this.lab.read;
    const given = this.lab.content.start;
    const { metre, turn } = unitsOf(this.lab.content);
    this.guess = this.bodies.map((body, i) =>
      start === undefined
        ? this.lab.lastGood.x[i + 1]
        : given[body.name] * (body.slides ? metre : turn),
    );
    this.inputs = this.bodies.map((body, i) => this.input(body, i));
    byId('guess').replaceChildren(...this.inputs.map((input) => input.parentNode));
    this.drawn = 0;
    this.run();
  }

  input(body, i) {
    const input = Object.assign(made('input'), { type: 'number', step: 'any' });
    const label = made('label', '', say('guess', body.name, body.slides ? 'mm' : '°'));
    const scale = body.slides ? 1000 : 360 / TAU;
    input.value = Number((this.guess[i] * scale).toPrecision(7));
    input.addEventListener('input', () => {
      if (input.value.trim() === '' || !Number.isFinite(Number(input.value))) return;
      this.guess[i] = Number(input.value) / scale;
      this.run();
    });
    label.append(input);
    return input;
  }

  take(guess) {
    this.guess = [...guess];
    this.inputs.forEach((input, i) => {
      input.value = Number((guess[i] * (this.bodies[i].slides ? 1000 : 360 / TAU)).toPrecision(7));
    });
    this.run();
  }

  guessAtRandom() {
    const { size } = this.lab.linkage;
    this.take(this.bodies.map((body) => (2 * Math.random() - 1) * (body.slides ? size : Math.PI)));
  }

  showExample() {
    this.lab.choose('klann');
    const [alpha, ...guess] = EXAMPLE.map((angle) => (angle * TAU) / 360);
    this.lab.turnTo(alpha);
    byId('rounded').checked = true;
    this.take(guess);
  }

  /** Iterate again when the crank rests. */
  soon() {
    clearTimeout(this.waiting);
    this.waiting = setTimeout(() => this.run(), 40);
  }

  run() {
    clearTimeout(this.waiting);
    const { linkage, alpha } = this.lab;
    this.found = newtonRaphson(
      linkage,
      [alpha, ...this.guess],
      MOST_CORRECTIONS,
      NEWTON_TOLERANCE,
    );
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
      const isDrawn = !pose.error && apartBy(linkage, last, pose.x) < SAME;
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
      .map((value, i) => made('td', '', this.shown(value, this.bodies[i].slides, k > 0)));
    const gap = residual === undefined ? '' : (1000 * residual).toExponential(2);
    row.append(first, ...cells, made('td', '', gap.replace('-', '\u2212')));
    return row;
  }

  shown(value, slides, isIterate) {
    if (slides) return decimals(1000 * value, 4);
    if (Math.abs(value) > 1e6) return value.toExponential(3);
    const rounded = byId('rounded').checked;
    // The guess is nobody's result.
    const angle = rounded && isIterate ? Math.round(value * PRINTED) / PRINTED : value;
    return decimals((angle * 360) / TAU, rounded ? 4 : 6);
  }

  draw(k) {
    this.drawn = k;
    byId('iterate').value = String(k);
    this.scene.iterate = k ? this.found.x[k - 1] : null;
    this.scene.show();
    this.mark();
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
