'use strict';
/*
 * Interactive figures: an image of a page whose name is a key of FIGURES becomes a drawing that the
 * reader turns. Without scripts, and until it comes near, the image stays; its text describes both.
 *
 * A plan of figures.yaml:
 *
 *   linkage: klann | a file's content     what is drawn; `lengths` [mm, deg] by name change it
 *   crank: 60                             the crank angle at first [deg]
 *   pick: [{name, linkage, lengths, crank}]   linkages to choose from, instead of one
 *   draw: [path, leg, angles]             layers, from below: LAYERS of layers.js
 *   charts: [transmission]                curves over the turn, or CHARTS of charts.js
 *   move: [{length: A-B, from, to}]       sliders of lengths [mm], or of a `state` of the layers
 *   state: {step: 20}                     states at first
 *   values: [angles]                      numbers below the drawing: VALUES of values.js
 *   play: step                            the button advances this state, instead of the crank
 *   caption: {en, pt}
 */

const WORDS = {
  en: {
    turn: 'Turn',
    stop: 'Stop',
    step: 'Next step',
    crank: 'Crank angle',
    pick: 'Linkage',
    curve: 'Curve',
    lab: 'Open in the lab',
    jammed: 'It does not close here.',
    figure: 'Interactive figure',
  },
  pt: {
    turn: 'Girar',
    stop: 'Parar',
    step: 'Próximo passo',
    crank: 'Ângulo da manivela',
    pick: 'Mecanismo',
    curve: 'Curva',
    lab: 'Abrir no laboratório',
    jammed: 'Aqui o mecanismo não fecha.',
    figure: 'Figura interativa',
  },
};
const DEGREE = TAU / 360;
// Turns a second, and the step of readers who do not want motion [rad].
const TURN_RATE = 0.2;
const STILL_STEP = 15 * DEGREE;
const stillness = matchMedia('(prefers-reduced-motion: reduce)');

/** Return a text of a plan in the page's language. */
function translated(text) {
  return typeof text === 'object' ? text[language.now] : text;
}

function word(key) {
  return WORDS[language.now][key];
}

function element(name, className = '', text = '') {
  const node = document.createElement(name);
  node.className = className;
  node.textContent = text;
  return node;
}

function contentOf(source) {
  return structuredCopy(typeof source === 'string' ? LINKAGES[source] : source);
}

/** Return the linkage of a plan, with its lengths. */
function linkageOf({ linkage: source, lengths = {}, outside = [], crank = 0 }) {
  const { linkage } = fromContent(contentOf(source));
  const { structure, signs, kept } = linkage;
  const read = new Linkage(structure, linkage.numbers, {
    ...kept,
    outside,
    ...(linkage.isDyadic ? { signs } : { start: linkage.start }),
  });
  const numbers = [...read.numbers];
  for (const [name, value] of Object.entries(lengths))
    numbers[dimensionNumber(read, name)] = value * unitOf(read, name);
  return Object.keys(lengths).length
    ? read.with(numbers, read.branchAt(crank * DEGREE, read.signs))
    : read;
}

function dimensionNumber({ structure }, name) {
  return structure.dimensions.findIndex((dimension) => dimension.name === name);
}

function unitOf({ structure }, name) {
  return structure.dimensions.find((dimension) => dimension.name === name).kind === 'bend'
    ? DEGREE
    : 1e-3;
}

class InteractiveFigure {
  constructor(image, plan) {
    this.plan = plan;
    this.state = { ...plan.state };
    this.isPlaying = false;
    this.isInSight = true;
    this.box = element('figure', 'interactive');
    this.box.dataset.figure = stemOf(image);
    this.box.setAttribute('role', 'group');
    this.box.setAttribute('aria-label', word('figure'));
    this.choose(plan.pick ? plan.pick[0] : plan);
    this.addStage(image.alt);
    this.addControls();
    this.rebuild();
    const paragraph = image.closest('p');
    const isAlone = paragraph && !paragraph.textContent.trim();
    (isAlone ? paragraph : image).replaceWith(this.box);
    new IntersectionObserver(([entry]) => {
      this.isInSight = entry.isIntersecting;
    }).observe(this.box);
  }

  choose(plan) {
    this.source = plan.linkage;
    this.alpha = (plan.crank ?? this.plan.crank ?? 0) * DEGREE;
    this.linkage = linkageOf({ outside: this.plan.outside, crank: 0, ...plan });
    this.direction = 1;
  }

  addStage(description) {
    const stage = element('div', 'interactive-stage');
    this.svg = document.createElementNS(SVG, 'svg');
    this.svg.setAttribute('role', 'img');
    this.svg.setAttribute('aria-label', description);
    stage.append(this.svg);
    this.charts = (this.plan.charts || []).map((name) => chartOf(this, name));
    for (const chart of this.charts) stage.append(chart.box);
    this.box.append(stage);
  }

  addControls() {
    const controls = element('div', 'interactive-controls');
    if (this.plan.pick) controls.append(this.pickField());
    this.button = element('button');
    this.button.type = 'button';
    this.button.addEventListener('click', () => this.play());
    if (this.plan.play !== 'none') controls.append(this.button);
    this.sliders = (this.plan.move || []).map((move) => new Slider(this, move));
    if (!this.plan.isFixed) this.sliders.unshift(new Slider(this, { crank: true }));
    controls.append(...this.sliders.map(({ label }) => label));
    this.values = element('dl', 'interactive-values');
    this.box.append(controls, this.values, this.captionOf());
  }

  pickField() {
    const label = element('label', '', `${word('pick')} `);
    const select = element('select');
    this.plan.pick.forEach(({ name, linkage }, k) =>
      select.append(new Option(translated(name) || titleOf(linkage), k)),
    );
    select.addEventListener('change', () => {
      this.choose(this.plan.pick[Number(select.value)]);
      this.rebuild();
    });
    label.append(select);
    return label;
  }

  captionOf() {
    const caption = element('figcaption', '', translated(this.plan.caption));
    this.labLink = element('a', '', word('lab'));
    caption.append(' ', this.labLink);
    return caption;
  }

  /** Draw the present linkage in a plane that holds its turn. */
  rebuild() {
    this.drawn = this.linkage;
    this.follow();
    const points = this.turn.pieces.flatMap((poses) => poses.flatMap((pose) => pose.points));
    const extra = (this.plan.draw || []).flatMap((name) =>
      EXTENTS[name] ? EXTENTS[name](this) : [],
    );
    const all = [...points, ...this.linkage.pivots, ...extra];
    this.drawing = new Drawing(this.svg, planeAround(all, { margin: 46 }));
    this.layers = ['ring', ...this.plan.draw].map((name) => LAYERS[name](this));
    if (!this.plan.isFixed) this.layers.push(grip(this));
    this.show();
  }

  /** Work out the whole turn. */
  follow() {
    this.turn = turnOf(this.linkage, reachableArcs(this.linkage), 120);
    this.period = this.turn.isTurn ? this.linkage.changes.period : 1;
    this.memory = {};
    for (const chart of this.charts || []) chart.draw();
  }

  /** Return what depends on the linkage alone, worked out once. */
  once(name, make) {
    if (!(name in this.memory)) this.memory[name] = make();
    return this.memory[name];
  }

  show() {
    this.pose = poseAt(this.linkage, this.alpha);
    for (const layer of this.layers) layer();
    for (const chart of this.charts) chart.mark();
    for (const slider of this.sliders) slider.show();
    this.showValues();
    const isStep = this.plan.play === 'step' || stillness.matches;
    this.button.textContent = word(isStep ? 'step' : this.isPlaying ? 'stop' : 'turn');
    this.labLink.href = this.labAddress();
  }

  showValues() {
    const rows = this.plan.values.flatMap((name) => VALUES[name](this));
    const jam = this.pose.error && !this.plan.isFixed ? [['', word('jammed')]] : [];
    this.values.replaceChildren(
      ...[...jam, ...rows].map(([name, text]) => {
        const row = element('div');
        row.append(element('dt', '', name), element('dd', '', text));
        return row;
      }),
    );
  }

  /** Return the address of the lab with this linkage and crank angle. */
  labAddress() {
    const { linkage, source, alpha } = this;
    const { structure } = linkage;
    const numbers = structure.dimensions.map(({ name }, n) =>
      inUnit(linkage.numbers[n], unitOf(linkage, name)),
    );
    const parts = { crank: Number((alpha / DEGREE).toFixed(6)) };
    if (typeof source === 'string')
      Object.assign(parts, { linkage: source, numbers: numbers.join() });
    else {
      const content = contentOf(source);
      structure.dimensions.forEach((dimension, n) => {
        const [holder, key] = slotOf(content, structure, dimension);
        if (numbers[n] || key in holder) holder[key] = numbers[n];
      });
      // YAML, too.
      parts.file = JSON.stringify(content);
    }
    const fragment = Object.entries(parts).map(
      ([key, text]) => `${key}=${encodeURIComponent(text).replaceAll('%2C', ',')}`,
    );
    const root = document.documentElement.dataset.content_root || '';
    return `${root}lab.html#${fragment.join('&')}`;
  }

  turnTo(alpha) {
    this.alpha = alpha;
    this.show();
  }

  /** Turn to an angle the shorter way round. */
  turnNear(alpha) {
    this.turnTo(this.alpha + wrap(alpha - this.alpha));
  }

  /** Change a length [m, rad]; one that is refused changes nothing. */
  setLength(name, value, isLast) {
    const numbers = [...this.linkage.numbers];
    numbers[dimensionNumber(this.linkage, name)] = value;
    try {
      this.linkage = this.linkage.with(numbers, this.linkage.branchAt(this.alpha));
    } catch (error) {
      if (!(error instanceof Refusal)) throw error;
    }
    if (isLast) {
      this.rebuild();
      return;
    }
    this.follow();
    this.show();
  }

  setState(name, value) {
    this.state[name] = value;
    for (const chart of this.charts) chart.draw();
    this.show();
  }

  play() {
    if (this.plan.play === 'step') {
      const { from, to } = this.plan.move.find(({ state }) => state === 'iterate');
      this.setState('iterate', this.state.iterate >= to ? from : this.state.iterate + 1);
      return;
    }
    if (stillness.matches) {
      this.moveBy(STILL_STEP);
      return;
    }
    this.isPlaying = !this.isPlaying;
    this.lastTime = null;
    this.show();
    if (this.isPlaying) requestAnimationFrame((now) => this.turnOn(now));
  }

  turnOn(now) {
    if (!this.isPlaying || !this.box.isConnected) return;
    const seconds = this.lastTime === null ? 0 : Math.min((now - this.lastTime) / 1000, 0.1);
    this.lastTime = now;
    if (this.isInSight) this.moveBy(seconds * TURN_RATE * TAU);
    requestAnimationFrame((next) => this.turnOn(next));
  }

  /** Turn the crank; where its arc ends it turns back. */
  moveBy(step) {
    const next = this.alpha + step * this.direction;
    if (poseAt(this.linkage, next).error && !this.pose.error) {
      this.direction = -this.direction;
      return;
    }
    this.turnTo(next);
  }
}

/** A slider of the crank, of a length, or of a state. */
class Slider {
  constructor(figure, move) {
    Object.assign(this, { figure, move });
    this.label = element('label', 'interactive-slider');
    const name = move.crank ? word('crank') : translated(move.name) || `|${move.length}|`;
    this.input = element('input');
    Object.assign(this.input, { type: 'range', ...this.range() });
    this.input.setAttribute('aria-label', name);
    this.output = element('output');
    this.label.append(element('span', '', name), this.input, this.output);
    this.input.addEventListener('input', () => this.take(false));
    this.input.addEventListener('change', () => this.take(true));
  }

  range() {
    const { crank, from, to, step } = this.move;
    return crank
      ? { min: 0, max: 360, step: 1 }
      : { min: from, max: to, step: step || (to - from) / 100 };
  }

  take(isLast) {
    const { figure, move } = this;
    const value = Number(this.input.value);
    if (move.crank) {
      if (!isLast) figure.turnNear(value * DEGREE);
    } else if (move.length) {
      figure.setLength(move.length, value * unitOf(figure.linkage, move.length), isLast);
    } else if (!isLast) figure.setState(move.state, value);
  }

  get value() {
    const { figure, move } = this;
    if (move.crank) return (((figure.alpha / DEGREE) % 360) + 360) % 360;
    if (!move.length) return figure.state[move.state];
    const { linkage } = figure;
    return linkage.numbers[dimensionNumber(linkage, move.length)] / unitOf(linkage, move.length);
  }

  show() {
    const { move, value } = this;
    const unit = move.crank ? '°' : (move.unit ?? (move.length ? ' mm' : ''));
    const text = decimals(value, move.digits ?? (move.crank || move.length ? 1 : 0)) + unit;
    const { figure } = this;
    const turn = Math.floor(figure.alpha / TAU) % figure.period;
    const turns =
      move.crank && figure.period > 1
        ? ` (${((turn + figure.period) % figure.period) + 1}/${figure.period})`
        : '';
    if (document.activeElement !== this.input || figure.isPlaying) this.input.value = value;
    this.input.setAttribute('aria-valuetext', text + turns);
    this.output.textContent = text + turns;
  }
}

/** Return a layer with what is grabbed to turn the crank. */
function grip(figure) {
  const { drawing, svg } = figure;
  const node = drawing.add('circle', 'interactive-grip');
  node.setAttribute('r', 22);
  const axle = figure.linkage.structure.bodies[0].points[0];
  node.addEventListener('pointerdown', (event) => {
    if (event.button) return;
    event.preventDefault();
    node.setPointerCapture(event.pointerId);
    const move = (moved) => {
      const matrix = svg.getScreenCTM().inverse();
      const at = new DOMPoint(moved.clientX, moved.clientY).matrixTransform(matrix);
      const { structure, pivots } = figure.linkage;
      const [x, y] = C.sub(drawing.metresAt([at.x, at.y]), pivots[structure.pivots.indexOf(axle)]);
      figure.turnNear(structure.senses[0] * Math.atan2(y, x));
    };
    const stop = () => node.removeEventListener('pointermove', move);
    node.addEventListener('pointermove', move);
    for (const name of ['pointerup', 'pointercancel'])
      node.addEventListener(name, stop, { once: true });
  });
  return () => {
    const { structure, pivots, bars } = figure.linkage;
    const u = C.polar(1, structure.senses[0] * figure.alpha);
    const [x, y] = drawing.at(C.add(pivots[structure.pivots.indexOf(axle)], C.mul(bars[0], u)));
    node.setAttribute('cx', x);
    node.setAttribute('cy', y);
  };
}

function titleOf(name) {
  return (language.now === 'pt' && TITLES[name]) || LINKAGES[name].name;
}

/** Make figures of the images, each when it comes near. */
function makeFigures() {
  language.now = document.documentElement.lang.startsWith('pt') ? 'pt' : 'en';
  const observer = new IntersectionObserver(
    (entries) => {
      for (const { isIntersecting, target } of entries) {
        if (!isIntersecting) continue;
        observer.unobserve(target);
        new InteractiveFigure(target, FIGURES[stemOf(target)]);
      }
    },
    { rootMargin: '600px' },
  );
  for (const image of document.images)
    if (Object.hasOwn(FIGURES, stemOf(image))) observer.observe(image);
}

function stemOf(image) {
  return image.getAttribute('src').replace(/^.*\/|\.\w+$/g, '');
}
