'use strict';
/* The charts of a leg, over time or over its crank angle; of two runs over each other. */

const DEGREES = 360 / TURN;
const MILLIMETRES = 1000;
// Smaller residuals are rounding, and a logarithm has no 0 [mm].
const MIN_RESIDUAL = 1e-14;
const CLOSE_TO_SINGULAR = [20, 160];

/** The kinds of charts; `columns` returns the lines of a leg, none without such values. */
const KINDS = [
  {
    key: 'angles',
    title: 'Joint angles',
    unit: 'angle / deg',
    digits: 2,
    columns: (leg) =>
      joints(leg, leg.angles, false).map(([angle, j]) =>
        column(leg.joints[j], aroundTheirMean(angle), j, j === 0),
      ),
  },
  {
    key: 'distances',
    title: 'Distances along lines',
    unit: 'distance / mm',
    digits: 1,
    columns: (leg) => scaledJoints(leg, leg.angles, true, MILLIMETRES),
  },
  {
    key: 'rates',
    title: 'Joint velocities',
    unit: 'velocity / deg/s',
    digits: 1,
    columns: (leg) => scaledJoints(leg, leg.rates, false, DEGREES),
  },
  {
    key: 'speeds',
    title: 'Velocities along lines',
    unit: 'velocity / mm/s',
    digits: 1,
    columns: (leg) => scaledJoints(leg, leg.rates, true, MILLIMETRES),
  },
  {
    key: 'transmission',
    title: 'Transmission angles',
    unit: 'angle / deg',
    digits: 1,
    limits: CLOSE_TO_SINGULAR,
    columns: (leg) =>
      leg.transmission.map((mu, i) => column(`dyad ${i + 1}`, scaled(mu, DEGREES), i + 1)),
  },
  {
    key: 'residuals',
    isDetail: true,
    title: 'Closure residual',
    unit: 'residual / mm',
    isLog: true,
    columns: (leg) => {
      const isKnown = leg.residuals.some(Number.isFinite);
      const shown = leg.residuals.map((residual) =>
        Math.max(residual * MILLIMETRES, MIN_RESIDUAL),
      );
      return isKnown ? [column('residual', shown, 1)] : [];
    },
  },
  {
    key: 'iterations',
    isDetail: true,
    title: 'Newton iterations',
    unit: 'most a pose',
    digits: 0,
    steps: [1, 2, 5, 10, 20, 50],
    isOverTimeOnly: true,
    isStepped: true,
    times: (leg) => leg.iterations.times,
    columns: (leg) =>
      leg.iterations.times.length ? [column('iterations', leg.iterations.most, 4)] : [],
  },
];

/** Return the values of those joints that slide, or of those that turn, each with its number. */
function joints(leg, values, slide) {
  return values.map((each, j) => [each, j]).filter(([, j]) => leg.slides[j] === slide);
}

/** Return the columns of those joints, times a factor. */
function scaledJoints(leg, values, slide, factor) {
  return joints(leg, values, slide).map(([series, j]) =>
    column(leg.joints[j], scaled(series, factor), j),
  );
}

function scaled(series, factor) {
  return series.map((number) => number * factor);
}

function column(name, values, colour, isHidden = false) {
  return { name, values, colour, isHidden };
}

class LegCharts {
  /** Make the charts of legs, one of each run; `onPick` gets the time that is clicked at. */
  constructor(holder, details, legs, { isOverCrank, onPick, whole }) {
    this.legs = legs;
    this.isOverCrank = isOverCrank && legs[0].hasPoses;
    this.whole = this.isOverCrank ? [0, 360] : whole;
    this.onPick = (x) => onPick(this.isOverCrank ? this.timeAtCrank(x) : x);
    this.charts = [];
    for (const kind of KINDS) this.add(kind.isDetail ? details : holder, kind);
  }

  add(holder, kind) {
    const found = this.legs.map((leg) => kind.columns(leg));
    const isOverCrank = this.isOverCrank && !kind.isOverTimeOnly;
    if (!found.flat().length || (this.isOverCrank && kind.isOverTimeOnly)) return;
    const lines = found.flatMap((columns, run) =>
      columns.map((each, i) => this.line(each, i, run)),
    );
    this.charts.push(
      new Chart(holder, {
        ...kind,
        text: this.legs
          .map((leg, run) => `${this.runName(run)}${leg.texts[kind.key] || ''}`)
          .join(' '),
        sync: isOverCrank ? 'crank' : 'time',
        xUnit: isOverCrank ? 'crank angle / deg' : 'time / s',
        isBand: isOverCrank,
        lines,
        data: isOverCrank ? this.overCrank(found) : this.overTime(found, kind),
        gaps:
          isOverCrank || kind.times
            ? null
            : found.flatMap((columns, run) => columns.map(() => this.legs[run].gaps)),
        onPick: this.onPick,
        onRange: (min, max) => this.range(min, max),
      }),
    );
  }

  line({ name, colour, isHidden }, i, run) {
    // The dash tells two runs apart; for one run it supports the colour.
    const dash = this.legs.length > 1 ? [[], [6, 4]][run] : DASHES[i % DASHES.length];
    return { name: `${this.runName(run)}${name}`, colour, isHidden, dash, isSecond: run > 0 };
  }

  runName(run) {
    return this.legs.length > 1 ? `${'AB'[run]}: ` : '';
  }

  overTime(found, kind) {
    const times = kind.times || ((leg) => leg.times);
    const tables = found.map((columns, run) => [
      Array.from(times(this.legs[run])),
      ...columns.map((each) => known(each.values)),
    ]);
    return tables.length > 1 ? uPlot.join(tables) : tables[0];
  }

  overCrank(found) {
    // Two runs may differ in how many bins they need; then each gives its own crank angles.
    const tables = found.map((columns, run) => {
      const leg = this.legs[run];
      return envelope(
        leg.angles[0] || [],
        columns.map((each) => each.values),
      );
    });
    return tables.length > 1 ? uPlot.join(tables) : tables[0];
  }

  timeAtCrank(degrees) {
    const row = this.legs[0].nearestAtCrank(degrees / DEGREES);
    return row < 0 ? 0 : this.legs[0].times[row];
  }

  /** Mark the moment in every chart. */
  mark(time) {
    const leg = this.legs[0];
    let x = time;
    if (this.isOverCrank) {
      const turned = leg.crankAngle(leg.nearest(time)) / TURN;
      x = (turned - Math.floor(turned)) * 360;
    }
    for (const chart of this.charts) chart.mark(x);
  }

  range(min, max) {
    if (!Number.isFinite(min) || !Number.isFinite(max)) return;
    this.shown = [min, max];
    for (const chart of this.charts) chart.range(min, max);
  }

  /** Show less or more of the horizontal axis, around a moment that is in it. */
  zoom(factor, time) {
    const [from, to] = this.shown || this.whole;
    const isIn = !this.isOverCrank && time >= from && time <= to;
    const middle = isIn ? time : (from + to) / 2;
    const half = ((to - from) / 2) * factor;
    const [first, last] = this.whole;
    this.range(Math.max(middle - half, first), Math.min(middle + half, last));
  }

  showAll() {
    this.range(...this.whole);
  }

  redraw() {
    for (const chart of this.charts) chart.redraw();
  }

  remove() {
    for (const chart of this.charts) chart.remove();
  }
}

/** Return values with null where there is none, as uPlot has it. */
function known(values) {
  return Array.from(values, (value) => (Number.isFinite(value) ? value : null));
}
