'use strict';
/* Curves of quantities over the crank angle, or over another quantity: a plot for each unit. */

// Pixels around a plot, its least height, and between plots.
const PLOT = { left: 56, right: 14, bottom: 34, height: 150, gap: 14 };
const MAX_CURVES = 6;
// Pixels on a printed page.
const PRINTED_WIDTH = 680;
const ORDER_TEXTS = ['', 'velocity', 'acceleration', 'advantage'];
const ANGLE_STEPS = [1, 2, 5, 10, 15, 30, 45, 90, 180, 360, 720];
// The least extent of an axis in its unit, below which all is rounding.
const LEAST_EXTENT = 1e-6;
const GOOD_TRANSMISSION = [40, 140];

/** Curves in an svg. `keys` are those of quantitiesOf, `across` is that of the x axis. */
class Curves {
  constructor(svg, lab) {
    Object.assign(this, { svg, lab, keys: [], across: '', plots: [] });
    lab.on('linkage', () => this.choose());
    lab.on('turn', () => this.compute());
    for (const event of ['pose', 'numbers']) lab.on(event, () => this.mark());
    svg.addEventListener('click', (event) => this.go(event));
    svg.addEventListener('keydown', (event) => this.turn(event));
    new ResizeObserver(() => this.draw()).observe(svg);
    window.addEventListener('beforeprint', () => this.draw(PRINTED_WIDTH));
    window.addEventListener('afterprint', () => this.draw());
  }

  /** Take the quantities of another linkage. */
  choose() {
    this.quantities = new Map(quantitiesOf(this.lab.linkage).map((q) => [q.key, q]));
    [this.crank] = this.quantities.keys();
    this.curves = null;
  }

  of(key) {
    return this.quantities.get(key);
  }

  /** Compute all curves over the turn, angles without jumps. */
  compute() {
    const { turn, linkage, rate } = this.lab;
    if (!turn || turn.linkage !== linkage) return;
    this.span = 360 * linkage.changes.period;
    this.states = turn.pieces.map((poses) => poses.map((pose) => stateOf(linkage, pose, rate)));
    this.curves = [this.across, ...this.keys].map((key) => ({
      key,
      pieces: this.states.map((piece) => this.values(key, piece)),
    }));
    this.draw();
  }

  values(key, piece) {
    let before = NaN;
    return piece.map((state) => {
      if (key === this.crank) return this.crankDegrees(state.pose.x[0]);
      const value = this.value(key, state);
      before = this.of(key).kind === 'angle' ? beside(before, value) : value;
      return before;
    });
  }

  value(key, state) {
    const { kind, of } = this.of(key);
    return KINDS[kind][2] * of(state);
  }

  /** Return a crank angle within its turns; their end is not their begin. */
  crankDegrees(alpha) {
    const degrees = (360 * alpha) / TAU;
    return Math.abs(degrees - this.span) < 1e-9 ? this.span : modulo(degrees, this.span);
  }

  // Drawing.

  get printedHeight() {
    return 310;
  }

  draw(printedWidth = 0) {
    const { svg, curves } = this;
    if (!curves) return;
    svg.replaceChildren();
    const [across, ...ups] = curves;
    const unitOf = ({ key }) => KINDS[this.of(key).kind][1];
    const units = [...new Set(ups.map(unitOf))];
    const least = units.length * (PLOT.height + PLOT.gap) + PLOT.bottom;
    svg.style.minHeight = `${least}px`;
    const width = printedWidth || Math.max(svg.clientWidth, 240);
    const height = printedWidth ? this.printedHeight : Math.max(svg.clientHeight, least);
    svg.setAttribute('viewBox', `0 0 ${width} ${height}`);
    const size = (height - PLOT.bottom) / units.length - PLOT.gap;
    const x = this.axis([across], [PLOT.left, width - PLOT.right]);
    this.plots = units.map((unit, n) => {
      const top = PLOT.gap + n * (size + PLOT.gap);
      const group = ups.filter((curve) => unitOf(curve) === unit);
      const y = this.axis(group, [top + size, top]);
      this.frame(x, y, group, n === units.length - 1);
      const clip = this.add('clipPath', '', { id: `${svg.id}-${n}` });
      this.box('', [x.from, x.to], [y.to, y.from], clip);
      for (const curve of group)
        this.add('path', this.lineClass(ups.indexOf(curve)), {
          d: this.line(across, curve, x, y),
          'clip-path': `url(#${svg.id}-${n})`,
        });
      return { x, y, group };
    });
    this.write(`${across.key} [${unitOf(across)}]`, (x.from + x.to) / 2, height - 3);
    this.cursor = this.add('path', 'chart-now', {});
    this.dots = ups.map((_, k) => this.add('circle', `curve-dot ${this.lineClass(k)}`, {}));
    svg.setAttribute('aria-label', `${this.keys.join(', ')} (${this.across})`);
    svg.setAttribute('aria-valuemax', this.span);
    this.mark();
  }

  /** Return an axis {from, to, low, high, step, at(value)} for curves in pixels [from, to]. */
  axis(group, [from, to]) {
    const { turn } = this.lab;
    const { kind, order } = this.of(group[0].key);
    const isAngle = kind === 'angle';
    const all = group.flatMap(({ pieces }) => pieces.flat()).filter(Number.isFinite);
    all.sort((a, b) => a - b);
    let [low, high] = all.length ? [all[0], all.at(-1)] : [0, 1];
    // What grows beyond all bounds, at dead points or where it is divided by 0, is cut off.
    if (order === 3 || (order && !turn.isTurn)) {
      const [p, q] = [0.08, 0.92].map((part) => all[Math.round(part * (all.length - 1))]);
      low = Math.max(low, p - 0.6 * (q - p));
      high = Math.min(high, q + 0.6 * (q - p));
    }
    if (group[0].key === this.crank) [low, high] = [0, this.span];
    else if (this.areTransmissions(group)) [low, high] = [0, 180];
    else {
      const extent = high - low;
      const room = extent < LEAST_EXTENT ? Math.max(1, Math.abs(high)) / 10 : 0.04 * extent;
      [low, high] = [low - room, high + room];
    }
    const size = (high - low) / 6;
    const step =
      (isAngle && size > 0.5 && ANGLE_STEPS.find((s) => s >= size)) || 2 * roundStep(size);
    return {
      from,
      to,
      low,
      high,
      step,
      at: (v) => from + ((v - low) / (high - low)) * (to - from),
    };
  }

  areTransmissions(group) {
    return group.every(({ key }) => this.of(key).dyad);
  }

  /** Draw what is behind the curves: bands, the grid, and the numbers and names of the axes. */
  frame(x, y, group, isLast) {
    const { turn } = this.lab;
    const [top, bottom] = [y.to, y.from];
    if (this.areTransmissions(group))
      this.box('chart-good', [x.from, x.to], GOOD_TRANSMISSION.map(y.at).reverse());
    if (this.across === this.crank && !turn.isTurn) {
      // The angles between arcs, and the same a turn before.
      const ends = turn.arcs.length ? turn.arcs.map(([, end]) => end) : [0];
      const starts = turn.arcs.slice(1).map(([start]) => start);
      starts.push((turn.arcs[0]?.[0] ?? 0) + TAU);
      const at = (alpha) => x.at(Math.min(Math.max((360 * alpha) / TAU, x.low), x.high));
      for (const back of [0, TAU])
        ends.forEach((end, k) =>
          this.box('chart-dead', [at(end - back), at(starts[k] - back)], [top, bottom]),
        );
    }
    const ticks = ({ low, high, step }) => {
      const first = Math.ceil(low / step - 1e-9);
      const count = Math.floor(high / step + 1e-9) - first + 1;
      const digits = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
      return Array.from({ length: count }, (_, k) => {
        const value = rounded((first + k) * step, step);
        return [value, decimals(value, digits)];
      });
    };
    for (const [value, text] of ticks(y)) {
      this.add('path', 'chart-axis', { d: `M${x.from} ${y.at(value)}H${x.to}` });
      this.write(text, x.from - 5, y.at(value) + 4, { 'text-anchor': 'end' });
    }
    for (const [value, text] of ticks(x)) {
      this.add('path', 'chart-axis', { d: `M${x.at(value)} ${top}V${bottom}` });
      if (isLast) this.write(text, x.at(value), bottom + 15);
    }
    const names = group.map(({ key }) => key).join(', ');
    const label = names.length * 7 > bottom - top ? '' : names;
    const middle = (top + bottom) / 2;
    const unit = KINDS[this.of(group[0].key).kind][1];
    this.write(`${label} [${unit}]`, 11, middle, { transform: `rotate(-90 11 ${middle})` });
  }

  add(name, className, attributes, parent = this.svg) {
    const node = document.createElementNS(SVG, name);
    if (className) node.setAttribute('class', className);
    for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
    parent.append(node);
    return node;
  }

  box(className, [x, right], [y, bottom], parent = this.svg) {
    const size = { width: Math.max(0, right - x), height: bottom - y };
    this.add('rect', className, { x, y, ...size }, parent);
  }

  write(text, x, y, attributes = {}) {
    this.add('text', '', { x, y, 'text-anchor': 'middle', ...attributes }).textContent = text;
  }

  lineClass(k) {
    return `chart-line dash-${k % 5} colour-${(k + 1) % BODY_COLOURS}`;
  }

  /** Return a line of a curve, for its legend. */
  keyOf(k) {
    const key = this.add('svg', '', { 'aria-hidden': 'true' }, made('span'));
    this.add('path', this.lineClass(k), { d: 'M0 4H34' }, key);
    return key;
  }

  line(across, { key, pieces }, x, y) {
    const isAdvantage = this.of(key).order === 3;
    const limit = (number) => Math.min(Math.max(number, -1e5), 1e5).toFixed(1);
    let d = '';
    pieces.forEach((piece, p) => {
      let pen = 'M';
      piece.forEach((value, i) => {
        const [u, before] = [across.pieces[p][i], across.pieces[p][i - 1]];
        // Where the crank begins again, and where a ratio goes through infinity.
        if (across.key === this.crank && u < before) pen = 'M';
        if (isAdvantage && value * piece[i - 1] < 0) pen = 'M';
        const isDrawn = Number.isFinite(value) && Number.isFinite(u);
        if (isDrawn) d += `${pen}${limit(x.at(u))} ${limit(y.at(value))}`;
        pen = isDrawn ? 'L' : 'M';
      });
    });
    return d;
  }

  // The cursor.

  mark() {
    if (!this.curves) return;
    const { linkage, pose, rate, alpha } = this.lab;
    const state = stateOf(linkage, pose, rate);
    const degrees = this.crankDegrees(alpha);
    const texts = this.keys.map((key) => {
      const { kind, of } = this.of(key);
      const unit = KINDS[kind][1] === '1' ? '' : ` ${KINDS[kind][1]}`;
      return `${shownQuantity(state ? of(state) : NaN, kind)}${unit}`;
    });
    this.shown?.forEach((node, k) => {
      node.textContent = texts[k];
    });
    const told = this.keys.map((key, k) => `${key} = ${texts[k]}`);
    this.svg.setAttribute('aria-valuenow', degrees.toFixed(2));
    this.svg.setAttribute('aria-valuetext', [turnText(alpha), ...told].join('; '));
    const values = state ? this.here(state, degrees) : [];
    let d = '';
    for (const { x, y, group } of this.plots) {
      if (state) d += `M${x.at(values[0])} ${y.from}V${y.to}`;
      for (const curve of group) {
        const k = this.curves.indexOf(curve);
        const isShown = values[k] >= y.low && values[k] <= y.high;
        const dot = this.dots[k - 1];
        dot.setAttribute('r', isShown ? 4.5 : 0);
        if (!isShown) continue;
        dot.setAttribute('cx', x.at(values[0]));
        dot.setAttribute('cy', y.at(values[k]));
      }
    }
    this.cursor.setAttribute('d', d);
  }

  /** Return the values of the curves at a state, angles beside those of the nearest sample. */
  here(state, degrees) {
    let [place, least] = [[0, 0], Infinity];
    this.states.forEach((piece, p) =>
      piece.forEach((sample, i) => {
        const turns = ((360 * sample.pose.x[0]) / TAU - degrees) / this.span;
        const distance = Math.abs(turns - Math.round(turns));
        if (distance < least) [place, least] = [[p, i], distance];
      }),
    );
    return this.curves.map(({ key, pieces }) => {
      if (key === this.crank) return degrees;
      const value = this.value(key, state);
      return this.of(key).kind === 'angle' ? beside(pieces[place[0]]?.[place[1]], value) : value;
    });
  }

  /** Turn the crank to what is clicked on its axis. */
  go(event) {
    const { lab, span, plots } = this;
    if (!plots.length || this.across !== this.crank) return;
    const { x } = plots[0];
    const part =
      (event.clientX - this.svg.getBoundingClientRect().left - x.from) / (x.to - x.from);
    const degrees = Math.min(Math.max(part, 0), 1) * span;
    const alpha = (rounded(degrees, roundStep(span / (x.to - x.from))) * TAU) / 360;
    const turns = (span * TAU) / 360;
    lab.turnTo(alpha - turns * Math.round((alpha - lab.alpha) / turns));
  }

  turn(event) {
    const way = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1 }[event.key];
    if (!way || event.altKey || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    this.lab.turnTo(this.lab.alpha + (way * (event.shiftKey ? 10 : 1) * TAU) / 360);
  }
}

/** Return an angle by whole turns from another, which may not be known [deg]. */
function beside(angle, value) {
  return Number.isFinite(angle) ? value - 360 * Math.round((value - angle) / 360) : value;
}

/** The transmission angles over the crank angle. */
class TurnChart extends Curves {
  get printedHeight() {
    return 150;
  }

  choose() {
    super.choose();
    this.across = this.crank;
    this.keys = [...this.quantities.values()].filter(({ dyad }) => dyad).map(({ key }) => key);
  }

  draw(printedWidth) {
    super.draw(printedWidth);
    if (!this.curves) return;
    const known = this.lab.turn.angles.filter(({ least }) => Number.isFinite(least));
    byId('legend').replaceChildren(
      ...known.map(({ least, greatest }, k) => {
        const item = made('span');
        item.append(this.keyOf(k), say('dyad', k + 1, degreesText(least), degreesText(greatest)));
        return item;
      }),
    );
  }
}

/** Curves that are chosen; those of another linkage stay where it has them. */
class CurvesPanel extends Curves {
  constructor(svg, lab) {
    super(svg, lab);
    byId('across').addEventListener('change', () => {
      this.across = byId('across').value;
      this.compute();
    });
    byId('add-curve').addEventListener('change', () => this.put(byId('add-curve').value));
  }

  choose() {
    super.choose();
    const [crank, first] = this.quantities.keys();
    this.keys = this.keys.filter((key) => this.of(key));
    if (!this.keys.length) this.keys = [first];
    if (!this.of(this.across)) this.across = crank;
    this.offer();
  }

  label({ key, body, dyad, name }) {
    const bar = body === undefined ? dyad && name : barOf(this.lab.linkage.structure.bodies[body]);
    return bar ? `${key} (${bar})` : key;
  }

  offer() {
    const options = () => {
      const groups = {};
      for (const quantity of this.quantities.values()) {
        const { key, body, dyad, order } = quantity;
        const about = dyad ? 'dyadName' : body === undefined ? 'pointName' : 'body';
        const name = say(about) + (order ? `: ${say(ORDER_TEXTS[order])}` : '');
        groups[name] ||= Object.assign(made('optgroup'), { label: name });
        groups[name].append(new Option(this.label(quantity), key));
      }
      return Object.values(groups);
    };
    byId('across').replaceChildren(...options());
    byId('across').value = this.across;
    byId('add-curve').replaceChildren(new Option('–', ''), ...options());
    this.legend();
  }

  put(key) {
    byId('add-curve').value = '';
    if (!this.of(key) || this.keys.includes(key)) return;
    this.keys = [...this.keys, key].slice(-MAX_CURVES);
    this.legend();
    this.compute();
  }

  /** Name the curves, each with a button that takes it away. */
  legend() {
    this.shown = this.keys.map(() => made('b'));
    byId('curve-legend').replaceChildren(
      ...this.keys.map((key, k) => {
        const button = made('button');
        Object.assign(button, { type: 'button', title: say('removeCurve', key) });
        button.append(
          this.keyOf(k),
          `${this.label(this.of(key))} = `,
          this.shown[k],
          made('i', '', ' ×'),
        );
        button.addEventListener('click', () => {
          this.keys = this.keys.filter((kept) => kept !== key);
          this.legend();
          this.compute();
          byId('add-curve').focus();
        });
        return button;
      }),
    );
  }
}
