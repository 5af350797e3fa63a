'use strict';
/* A chart of lines by uPlot, with its title, its legend, a sentence about it, and the moment. */

// Between the labels of a crank angle [deg].
const CRANK_STEPS = [1, 2, 5, 10, 15, 30, 45, 90];

/** A chart with a sentence about it. */
class DescribedFigure extends PlotFigure {
  constructor(holder, className, title, text) {
    super(holder, className, title, `${title}. ${text}`, make('figcaption', '', text));
  }
}

class Chart extends DescribedFigure {
  /**
   * Make a chart.
   *
   * title, text: what it shows, in a few words and in a sentence
   * unit: of its values
   * xUnit: of its horizontal axis
   * isLog: whether its values are shown by their powers of ten
   * steps: between the labels of its values, where not any will do
   * limits: values at which lines are drawn
   * lines: [{name, colour, dash, isSecond, isHidden}]
   * data: what uPlot draws: x, then a column each line; of bands two each
   * isBand: whether each line is a band from its first to its second column
   * isStepped: whether each value stands for the time since the one before
   * gaps: for each line, pairs of x between which there is nothing
   */
  constructor(holder, settings) {
    super(holder, 'card chart', settings.title, settings.text);
    this.settings = settings;
    this.onPick = settings.onPick || (() => {});
    this.onRange = settings.onRange || (() => {});
    this.legend = new Legend(settings, (line, isShown) => this.show(line, isShown));
    this.canvas.before(this.legend.node);
    this.draw(this.options(), settings.data);
    this.now = make('div', 'now');
    this.plot.over.append(this.now);
    this.x = NaN;
    pickByClick(this.plot, (u) => this.onPick(u.posToVal(u.cursor.left, 'x')));
  }

  options() {
    const { settings } = this;
    return {
      width: this.width(),
      height: HEIGHT,
      padding: [12, 12, 0, 0],
      legend: { show: false },
      cursor: {
        y: false,
        drag: { x: true, y: false },
        sync: { key: settings.sync, scales: ['x', null] },
      },
      scales: {
        x: { time: false },
        y: settings.isLog ? { distr: 3, range: powers } : {},
      },
      axes: [
        { ...axis(settings.xUnit, 28), ...(settings.isBand && { incrs: CRANK_STEPS }) },
        {
          ...axis(settings.unit, 52, settings.isLog),
          ...(settings.steps && { incrs: settings.steps }),
        },
      ],
      series: [{}, ...settings.lines.flatMap((line, i) => this.series(line, i))],
      bands: settings.isBand ? settings.lines.map((line, i) => band(line, i)) : [],
      hooks: {
        draw: [(u) => drawLimits(u, settings.limits || [])],
        setCursor: [(u) => this.legend.showAt(u, this.x)],
        setScale: [(u, key) => key === 'x' && this.ranged(u.scales.x)],
      },
    };
  }

  series(line, i) {
    const one = {
      label: line.name,
      stroke: () => bodyColour(line.colour),
      width: 1.5,
      dash: line.dash,
      alpha: line.isSecond ? 0.65 : 1,
      show: !line.isHidden,
      points: { show: false },
      spanGaps: Boolean(this.settings.isBand),
      ...(this.settings.isStepped && { paths: uPlot.paths.stepped({ align: -1 }) }),
      gaps: (u, _, first, last, gaps) => [
        ...gaps,
        ...pixelGaps(u, this.settings.gaps && this.settings.gaps[i]),
      ],
    };
    return this.settings.isBand ? [one, { ...one }] : [one];
  }

  show(line, isShown) {
    const columns = this.settings.isBand ? [2 * line + 1, 2 * line + 2] : [line + 1];
    for (const column of columns) this.plot.setSeries(column, { show: isShown });
  }

  /** Mark the time that the page shows. */
  mark(x) {
    this.x = x;
    this.moveNow();
    this.legend.showAt(this.plot, x);
  }

  moveNow() {
    if (!this.now) return;
    const left = this.plot.valToPos(this.x, 'x');
    const isInside = left >= 0 && left <= this.plot.over.clientWidth;
    this.now.hidden = !isInside;
    if (isInside) this.now.style.transform = `translateX(${left}px)`;
  }

  ranged({ min, max }) {
    this.moveNow();
    this.onRange(min, max);
  }

  /** Show a part of the horizontal axis; nothing happens where it is shown already. */
  range(min, max) {
    const x = this.plot.scales.x;
    if (x.min !== min || x.max !== max) this.plot.setScale('x', { min, max });
  }

  fit() {
    super.fit();
    this.moveNow();
  }
}

function band(line, i) {
  return { series: [2 * i + 2, 2 * i + 1], fill: () => `${bodyColour(line.colour)}33` };
}

function pixelGaps(u, gaps) {
  return (gaps || []).map(([from, to]) => [
    u.valToPos(from, 'x', true),
    u.valToPos(to, 'x', true),
  ]);
}

function drawLimits(u, limits) {
  const { ctx, bbox } = u;
  ctx.save();
  ctx.strokeStyle = themeColour('bad');
  ctx.lineWidth = devicePixelRatio;
  ctx.setLineDash([6 * devicePixelRatio, 4 * devicePixelRatio]);
  for (const limit of limits) {
    const y = u.valToPos(limit, 'y', true);
    if (y >= bbox.top && y <= bbox.top + bbox.height) {
      ctx.beginPath();
      ctx.moveTo(bbox.left, y);
      ctx.lineTo(bbox.left + bbox.width, y);
      ctx.stroke();
    }
  }
  ctx.restore();
}

/** Call a function on a click that is not a drag. */
function pickByClick(plot, pick) {
  let from = null;
  plot.over.addEventListener('mousedown', (event) => {
    from = [event.clientX, event.clientY];
  });
  plot.over.addEventListener('click', (event) => {
    if (from && Math.hypot(event.clientX - from[0], event.clientY - from[1]) < 4) pick(plot);
  });
}
