'use strict';
/* Charts beside a drawing: curves over the turn with a cursor, and those of Newton-Raphson. */

// Where the axes are in a chart's units.
const CHART = { width: 400, height: 226, left: 46, right: 380, top: 12, bottom: 178 };
const PLANE = { width: 400, height: 380, left: 50, right: 380, top: 12, bottom: 342 };
const BASIN_PIXELS = 90;
// Colours of the assemblies that are reached, and of none.
const BASINS = [
  [47, 102, 149],
  [176, 122, 18],
  [130, 130, 130],
];
const CONDITION_ROUNDS = 40;

/** Return the condition number of a matrix, by powers of its square. */
function conditionOf(matrix) {
  const n = matrix.length;
  const square = matrix[0].map((_, i) =>
    matrix[0].map((_, j) => matrix.reduce((sum, row) => sum + row[i] * row[j], 0)),
  );
  const norm = (next) => {
    let x = Array.from({ length: n }, (_, i) => 1 + i / 10);
    let size = 0;
    for (let k = 0; k < CONDITION_ROUNDS; k += 1) {
      const y = next(x);
      if (!y) return Infinity;
      size = Math.hypot(...y);
      x = y.map((value) => value / size);
    }
    return size;
  };
  const times = (x) => square.map((row) => row.reduce((sum, value, j) => sum + value * x[j], 0));
  return Math.sqrt(norm(times) * norm((x) => solved(square, x).x));
}

// Curves over the crank angle: a name, a unit, and the numbers of a pose.
const CURVES = {
  transmission: {
    name: { en: 'Transmission angle', pt: 'Ângulo de transmissão' },
    unit: '°',
    range: [0, 180],
    band: [40, 140],
    of: ({ linkage }, { u }) => linkage.blocks.map((block) => block.transmissionAngle(u) / DEGREE),
    labels: ({ linkage }) =>
      linkage.blocks.map((_, k) => (linkage.blocks.length > 1 ? `μ${'₁₂₃₄₅'[k]}` : 'μ')),
  },
  angles: {
    name: { en: 'Angles', pt: 'Ângulos' },
    unit: '°',
    of: (_, { x }) => x.slice(1).map((value) => value / DEGREE),
    labels: ({ linkage }) => linkage.structure.angles.slice(1).map(angleLetter),
  },
  condition: {
    name: { en: 'Condition number of Φ', pt: 'Número de condição de Φ' },
    unit: '',
    range: [0, 16],
    of: ({ linkage }, { x }) => [conditionOf(linkage.equations(x).phi)],
    labels: () => ['cond Φ'],
  },
  rates: {
    name: { en: 'Rates by the crank’s', pt: 'Velocidades pela da manivela' },
    unit: '',
    // In a change point they are 0/0.
    of: ({ linkage }, pose) => {
      const isSingular = linkage.blocks.some((block) => Math.abs(block.sine(pose.u)) < 0.02);
      return (ratesOf(linkage, pose) || pose.x).slice(1).map((rate) => (isSingular ? NaN : rate));
    },
    labels: ({ linkage }) => {
      const [crank, ...names] = linkage.structure.angles.map(angleLetter);
      return names.map((name) => `d${name}/d${crank}`);
    },
  },
  ram: {
    name: { en: 'Position of the ram', pt: 'Posição do cabeçote' },
    unit: ' mm',
    of: ({ turn }, { points }) => [1000 * points[turn.foot][0]],
    labels: () => ['x'],
  },
  speed: {
    name: { en: 'Speed of the foot', pt: 'Velocidade do pé' },
    unit: ' mm/rad',
    of: ({ linkage, turn }, pose) => [
      1000 * C.abs(velocityOf(linkage, pose, turn.foot) || [NaN, NaN]),
    ],
    labels: () => ['|dH/dα|'],
  },
};

const CHARTS = {
  convergence: (figure) => new ConvergenceChart(figure),
  basins: (figure) => new BasinChart(figure),
};

function chartOf(figure, name) {
  return CHARTS[name] ? CHARTS[name](figure) : new CurveChart(figure, CURVES[name]);
}

/** An empty chart with axes. */
class Chart {
  constructor(figure, title, frame = CHART) {
    this.figure = figure;
    this.frame = frame;
    this.box = element('div', 'interactive-chart');
    this.svg = document.createElementNS(SVG, 'svg');
    this.svg.setAttribute('viewBox', `0 0 ${frame.width} ${frame.height}`);
    this.svg.setAttribute('role', 'img');
    this.svg.setAttribute('aria-label', title);
    this.box.append(element('p', 'interactive-title', title), this.svg);
  }

  add(name, className, attributes, text = '') {
    const node = document.createElementNS(SVG, name);
    node.setAttribute('class', className);
    for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
    node.textContent = text;
    this.svg.append(node);
    return node;
  }

  at(x, y) {
    const [[left, right], [low, high]] = [this.xRange, this.yRange];
    return [
      this.frame.left + ((this.frame.right - this.frame.left) * (x - left)) / (right - left),
      this.frame.bottom - ((this.frame.bottom - this.frame.top) * (y - low)) / (high - low),
    ];
  }

  axes(xTicks, yTicks, xText, yText) {
    for (const y of yTicks) {
      const [, place] = this.at(this.xRange[0], y);
      this.add('path', 'chart-axis', { d: `M${this.frame.left} ${place}H${this.frame.right}` });
      const attributes = { x: this.frame.left - 5, y: place + 4, 'text-anchor': 'end' };
      this.add('text', 'chart-text', attributes, yText(y));
    }
    for (const x of xTicks) {
      const [place] = this.at(x, this.yRange[0]);
      const attributes = { x: place, y: this.frame.bottom + 16, 'text-anchor': 'middle' };
      this.add('text', 'chart-text', attributes, xText(x));
    }
  }

  line(points) {
    let pen = 'M';
    let d = '';
    for (const [x, y] of points) {
      const isSeen = Number.isFinite(y);
      if (isSeen) {
        const [left, top] = this.at(x, Math.min(Math.max(y, this.yRange[0]), this.yRange[1]));
        d += `${pen}${left.toFixed(1)} ${top.toFixed(1)}`;
      }
      pen = isSeen ? 'L' : 'M';
    }
    return d;
  }

  /** Call a function with the place of a pointer that is pressed, as long as it is. */
  onDrag(node, take) {
    const move = (event) => {
      const matrix = this.svg.getScreenCTM().inverse();
      const { x, y } = new DOMPoint(event.clientX, event.clientY).matrixTransform(matrix);
      const [[left, right], [low, high]] = [this.xRange, this.yRange];
      take(
        left + ((right - left) * (x - this.frame.left)) / (this.frame.right - this.frame.left),
        low + ((high - low) * (this.frame.bottom - y)) / (this.frame.bottom - this.frame.top),
      );
    };
    node.addEventListener('pointerdown', (event) => {
      if (event.button) return;
      event.preventDefault();
      node.setPointerCapture(event.pointerId);
      move(event);
      const stop = () => node.removeEventListener('pointermove', move);
      node.addEventListener('pointermove', move);
      for (const name of ['pointerup', 'pointercancel'])
        node.addEventListener(name, stop, { once: true });
    });
  }
}

/** Return about five round numbers in a range. */
function ticksIn([low, high]) {
  const step = roundStep((high - low) / 3);
  const first = Math.ceil(low / step - 1e-9);
  const count = Math.floor(high / step + 1e-9) - first + 1;
  return Array.from({ length: count }, (_, k) => rounded((first + k) * step, step));
}

/** Curves over the crank angle, with a cursor that is dragged. */
class CurveChart extends Chart {
  constructor(figure, curve) {
    super(figure, translated(curve.name));
    this.curve = curve;
    this.onDrag(this.svg, (degrees) =>
      figure.turnTo(Math.min(Math.max(degrees, 0), 360 * figure.period) * DEGREE),
    );
  }

  draw() {
    const { figure, curve } = this;
    this.svg.replaceChildren();
    const turnDegrees = 360 * figure.period;
    this.xRange = [0, turnDegrees];
    const rows = figure.turn.pieces.map((poses) =>
      poses.map((pose) => [pose.x[0] / DEGREE, curve.of(figure, pose)]),
    );
    this.yRange = curve.range || rangeOf(rows.flat().flatMap(([, values]) => values));
    if (curve.band) {
      const [, top] = this.at(0, curve.band[1]);
      const [, bottom] = this.at(0, curve.band[0]);
      const width = this.frame.right - this.frame.left;
      this.add('rect', 'chart-good', { x: this.frame.left, y: top, width, height: bottom - top });
    }
    const quarters = [0, 1, 2, 3, 4].map((k) => (k * turnDegrees) / 4);
    const yTicks =
      curve.unit === '°' && curve.range ? [0, 45, 90, 135, 180] : ticksIn(this.yRange);
    this.axes(
      quarters,
      yTicks,
      (x) => `${x}°`,
      (y) =>
        general(y)
          .replace('-', '−')
          .replace('.', language.now === 'pt' ? ',' : '.'),
    );
    const count = rows[0]?.[0]?.[1].length || 0;
    for (let k = 0; k < count; k += 1) {
      const d = rows.map((row) => this.curveLine(row, k)).join('');
      this.add('path', `chart-line dash-${k % 5} colour-${(k + 1) % BODY_COLOURS}`, { d });
    }
    this.cursor = this.add('path', 'chart-now', { d: '' });
    this.legend(count);
  }

  /** Draw a curve; an angle that passes 180 degrees begins again at -180. */
  curveLine(row, k) {
    const points = [];
    let before = null;
    for (const [alpha, values] of row) {
      const x = ((alpha % this.xRange[1]) + this.xRange[1]) % this.xRange[1];
      const place = alpha === this.xRange[1] ? alpha : x;
      const isJump = before && (place < before[0] || Math.abs(values[k] - before[1]) > 180);
      if (isJump) points.push([place, NaN]);
      points.push([place, values[k]]);
      before = [place, values[k]];
    }
    return this.line(points);
  }

  legend(count) {
    const labels = this.curve.labels(this.figure).slice(0, count);
    labels.forEach((label, k) => {
      const x =
        this.frame.left + 6 + k * (25 + 9 * Math.max(4, ...labels.map((text) => text.length)));
      const y = this.frame.height - 6;
      const className = `chart-line dash-${k % 5} colour-${(k + 1) % BODY_COLOURS}`;
      this.add('path', className, { d: `M${x} ${y - 4}h20` });
      this.add('text', 'chart-text', { x: x + 25, y }, label);
    });
  }

  mark() {
    if (!this.cursor) return;
    const turn = TAU * this.figure.period;
    const degrees = (((this.figure.alpha % turn) + turn) % turn) / DEGREE;
    const [x] = this.at(degrees, this.yRange[0]);
    this.cursor.setAttribute('d', `M${x} ${this.frame.top}V${this.frame.bottom}`);
  }
}

function rangeOf(values) {
  const finite = values.filter(Number.isFinite);
  const [low, high] = [Math.min(...finite, 0), Math.max(...finite, 0)];
  const margin = 0.06 * (high - low || 1);
  return [low < 0 ? low - margin : 0, high + margin];
}

/** The error of the iterates, each against the one before it. */
class ConvergenceChart extends Chart {
  constructor(figure) {
    super(
      figure,
      translated({ en: 'Error of the iterates [rad]', pt: 'Erro das iterações [rad]' }),
    );
    this.xRange = [1, 8];
    this.yRange = [-16, 1];
  }

  draw() {
    const { figure } = this;
    this.svg.replaceChildren();
    this.axes(
      [1, 2, 3, 4, 5, 6, 7, 8],
      [0, -4, -8, -12, -16],
      (k) => `x${'₀₁₂₃₄₅₆₇₈'[k]}`,
      (y) => `10${power(y)}`,
    );
    const { x, converged } = iteratesOf(figure);
    if (!converged) return;
    const last = x.at(-1);
    x[0].slice(1).forEach((_, j) => {
      const points = x
        .slice(0, -1)
        .map((iterate, k) => [
          k + 1,
          Math.log10(Math.abs(wrap(iterate[j + 1] - last[j + 1])) || 1e-16),
        ]);
      const shown = points.filter(([k]) => k <= 8);
      const className = `chart-line dash-${j % 5} colour-${(j + 1) % BODY_COLOURS}`;
      this.add('path', className, { d: this.line(shown) });
      const dots = shown.map(([k, y]) => this.at(k, Math.max(y, -16)));
      const d = dots.map(([left, top]) => `M${left} ${top}h0`).join('');
      this.add('path', `chart-dots colour-${(j + 1) % BODY_COLOURS}`, { d });
      const label = angleLetter(figure.linkage.structure.angles[j + 1]);
      const place = this.frame.left + 6 + j * 62;
      const y = this.frame.height - 6;
      this.add('path', className, { d: `M${place} ${y - 4}h20` });
      this.add('text', 'chart-text', { x: place + 25, y }, label);
    });
    this.cursor = this.add('path', 'chart-now', { d: '' });
  }

  mark() {
    if (!this.cursor || !this.cursor.isConnected) return;
    const [x] = this.at(Math.min(this.figure.state.iterate, 8), -16);
    this.cursor.setAttribute('d', `M${x} ${this.frame.top}V${this.frame.bottom}`);
  }
}

function power(exponent) {
  return Array.from(String(exponent), (c) => (c === '-' ? '⁻' : '⁰¹²³⁴⁵⁶⁷⁸⁹'[c])).join('');
}

/** The plane of guesses for two angles: which assembly Newton-Raphson reaches from each. */
class BasinChart extends Chart {
  constructor(figure) {
    const title = {
      en: 'Where each guess leads: drag the white point',
      pt: 'Aonde leva cada chute inicial: arraste o ponto branco',
    };
    super(figure, translated(title), PLANE);
    this.box.classList.add('interactive-basins');
    this.xRange = [-180, 180];
    this.yRange = [-180, 180];
    this.names = figure.linkage.structure.angles.slice(1);
    this.onDrag(this.svg, (...place) => {
      place.forEach((value, k) => {
        figure.state[this.names[k]] = rounded(Math.min(Math.max(value, -180), 180), 1);
      });
      figure.setState('iterate', 1);
    });
  }

  draw() {
    const address = this.figure.once('basins', () => this.picture());
    if (!this.image) {
      const { left, right, top, bottom } = this.frame;
      const place = { x: left, y: top, width: right - left, height: bottom - top };
      const ticks = [-180, -90, 0, 90, 180];
      const text = (degrees) => inLocale(`${degrees}°`);
      this.axes(ticks, ticks, text, text);
      this.image = this.add('image', 'basins', { ...place, preserveAspectRatio: 'none' });
      const [first, second] = this.names.map(angleLetter);
      const middle = (left + right) / 2;
      const axis = { x: middle, y: this.frame.height - 4, 'text-anchor': 'middle' };
      this.add('text', 'chart-text', axis, first);
      this.add('text', 'chart-text', { x: 4, y: (top + bottom) / 2 - 24 }, second);
      this.steps = this.add('path', 'basin-steps', { d: '' });
      this.point = this.add('circle', 'basin-point', { r: 8 });
    }
    this.image.setAttribute('href', address);
  }

  /** Return the colours of all guesses as the address of an image; darker after more corrections. */
  picture() {
    const { linkage, alpha } = this.figure;
    const canvas = element('canvas');
    Object.assign(canvas, { width: BASIN_PIXELS, height: BASIN_PIXELS });
    const context = canvas.getContext('2d');
    const image = context.createImageData(BASIN_PIXELS, BASIN_PIXELS);
    const angle = (k) => ((2 * k + 1) / BASIN_PIXELS - 1) * Math.PI;
    for (let row = 0; row < BASIN_PIXELS; row += 1)
      for (let column = 0; column < BASIN_PIXELS; column += 1) {
        const start = [alpha, angle(column), -angle(row)];
        const { x, converged } = newtonRaphson(linkage, start, 20, 1e-6);
        const sine = converged ? linkage.blocks[0].sine(linkage.vectors(x.at(-1))) : 0;
        const colour = BASINS[converged ? (sine > 0 ? 0 : 1) : 2];
        const light = Math.max(0.6, 1.55 - 0.09 * x.length);
        const pixel = colour.map((part) => Math.min(255, part * light));
        image.data.set([...pixel, 255], 4 * (row * BASIN_PIXELS + column));
      }
    context.putImageData(image, 0, 0);
    return canvas.toDataURL();
  }

  mark() {
    const { x } = iteratesOf(this.figure);
    const places = x.map((iterate) => iterate.slice(1).map((value) => wrap(value) / DEGREE));
    const points = places.map(([first, second]) => this.at(first, second));
    // A step over the edge comes in at the other side.
    const lines = points.map(([left, top], k) => {
      const isNear =
        k && Math.hypot(...places[k].map((value, i) => value - places[k - 1][i])) < 180;
      return `${isNear ? 'L' : 'M'}${left.toFixed(1)} ${top.toFixed(1)}`;
    });
    const dots = points.map(([left, top]) => `M${left.toFixed(1)} ${top.toFixed(1)}h0`);
    this.steps.setAttribute('d', lines.join('') + dots.join(''));
    this.point.setAttribute('cx', points[0][0]);
    this.point.setAttribute('cy', points[0][1]);
  }
}
