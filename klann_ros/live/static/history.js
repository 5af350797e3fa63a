'use strict';
/* The last half minute of a leg, and its charts. */

const SPAN = 30;
// Update period of the charts [ms].
const CHART_PERIOD = 200;
// Averaging time of a speed [s].
const RATE_TIME = 0.2;
// Averaging time of the crank's speed beside its slider [s].
const SPEED_TIME = 0.5;
// Of the plots, and of the labels of their axes.
const CHART_HEIGHT = 180;
const LABEL_SIZE = 18;

/** The received poses of a leg. */
class Track {
  constructor(leg) {
    this.leg = leg;
    this.times = [];
    this.poses = [];
    this.stamps = [];
    this.feet = [];
    this.x = null;
    this.points = null;
    this.foot = null;
    this.footIndex = leg.shape ? leg.shape.points.findIndex((point) => point.name === leg.shape.foot) : -1;
    this.age = Infinity;
  }

  /** Add a pose: its age and stamp [s], and its coordinates. */
  add(now, [age, stamp, ...x]) {
    this.age = age;
    const time = now - age;
    const last = this.times.length ? this.times[this.times.length - 1] : -Infinity;
    const isSame = this.x && x.every((value, i) => value === this.x[i]);
    if (!isSame) {
      this.x = x;
      this.points = pointsOf(this.leg.shape, x);
      this.foot = this.points[this.footIndex];
    }
    // A repeated pose, or one at rest, is a point of the chart all the same.
    if (time <= last || (isSame && time < last + 0.05)) return;
    this.times.push(time);
    this.poses.push(x);
    this.stamps.push(stamp);
    this.feet.push(this.foot);
    this.forget(now - SPAN - 1);
  }

  forget(before) {
    if (this.times[0] > before - 1) return;
    const first = this.times.findIndex((time) => time >= before);
    for (const column of [this.times, this.poses, this.stamps, this.feet]) column.splice(0, first);
  }

  /** Return the mean speed of the crank in the last SPEED_TIME [deg/s]; NaN if it is unknown. */
  crankSpeed() {
    const last = this.stamps.length - 1;
    let first = last;
    while (first > 0 && this.stamps[last] - this.stamps[first] < SPEED_TIME) first -= 1;
    const passed = this.stamps[last] - this.stamps[first];
    return passed > 0 && passed < 4 * SPEED_TIME ? degrees(this.poses[last][0] - this.poses[first][0]) / passed : NaN;
  }

  /** Return the places of the foot in the last seconds. */
  trail(seconds) {
    const { times } = this;
    let first = times.length;
    const begin = times[first - 1] - seconds;
    while (first > 0 && times[first - 1] >= begin) first -= 1;
    return this.feet.slice(first);
  }
}

/** One chart over the last half minute. */
class LiveChart extends PlotFigure {
  constructor(holder, title, unit, lines) {
    super(holder, 'card chart', title, `${title} over the last ${SPAN} s`);
    this.lines = lines;
    this.values = lines.map(() => make('b', ''));
    const names = lines.map(({ name }, i) => make('span', 'key-line', `${name} `, this.values[i]));
    names.forEach((node, i) => (node.style.borderColor = `var(--body-${lines[i].colour})`));
    this.canvas.before(make('p', 'legend', ...names));
    const axes = [axis('s', 24), axis(unit, 48)];
    this.draw(
      {
        width: this.width(),
        height: CHART_HEIGHT,
        padding: [8, 10, 0, 0],
        legend: { show: false },
        cursor: { show: false },
        scales: { x: { time: false, range: [-SPAN, 0] } },
        axes: axes.map((plotAxis) => ({ ...plotAxis, labelSize: LABEL_SIZE })),
        series: [
          {},
          ...lines.map((line) => ({
            stroke: () => bodyColour(line.colour),
            width: 1.5,
            dash: line.dash,
            points: { show: false },
          })),
        ],
      },
      [[], ...lines.map(() => [])],
    );
  }

  height() {
    return CHART_HEIGHT;
  }

  show(times, columns) {
    this.plot.setData([times, ...columns]);
    this.values.forEach((node, i) => {
      const value = columns[i][columns[i].length - 1];
      node.textContent = Number.isFinite(value) ? fixedText(value, this.lines[i].digits) : '–';
    });
  }
}

/** The charts of one leg. */
class History {
  constructor(holder, leg) {
    holder.replaceChildren();
    this.leg = leg;
    const lines = leg.joints.map((name, i) => ({ i, name, colour: i % BODY_COLOURS, dash: DASHES[i % 7] }));
    this.angles = lines.filter((line) => !leg.slides[line.i]).map((line) => ({ ...line, digits: 1 }));
    this.slides = lines.filter((line) => leg.slides[line.i]).map((line) => ({ ...line, digits: 1 }));
    const place = ['x', 'y'].map((name, i) => ({ name, colour: i, dash: DASHES[i], digits: 1 }));
    const point = leg.point[0].toUpperCase() + leg.point.slice(1);
    this.charts = [
      new LiveChart(holder, 'Angles', '°', this.angles),
      new LiveChart(holder, this.slides.length ? `${point} and slides` : point, 'mm', [...place, ...this.slides]),
      new LiveChart(holder, 'Crank speed', '°/s', [{ name: 'rate', colour: 1, dash: [], digits: 1 }]),
    ];
    this.last = 0;
  }

  /** Show a track, if it is time to. */
  show(track, now) {
    if ((now - this.last) * 1000 < CHART_PERIOD) return;
    this.last = now;
    const times = track.times.map((time) => time - now);
    const isAcross = (i, j) => Math.abs(wrapped(track.poses[i][j]) - wrapped(track.poses[i - 1][j])) > 3;
    const angle = ({ i: j }) =>
      track.poses.map((x, i) => (i > 0 && isAcross(i, j) ? null : degrees(wrapped(x[j]))));
    this.charts[0].show(times, this.angles.map(angle));
    this.charts[1].show(times, [
      ...[0, 1].map((axis) => track.feet.map((foot) => 1000 * foot[axis])),
      ...this.slides.map(({ i }) => track.poses.map((x) => 1000 * x[i])),
    ]);
    this.charts[2].show(times, [rates(track)]);
  }
}

/** Return the rates of the crank, from the stamps of poses RATE_TIME apart [deg/s]. */
function rates({ times, poses, stamps }) {
  let j = 0;
  return times.map((time, i) => {
    while (j < i && stamps[i] - stamps[j + 1] >= RATE_TIME) j += 1;
    const passed = stamps[i] - stamps[j];
    return time - times[j] < 1 && passed > 0 ? degrees(poses[i][0] - poses[j][0]) / passed : null;
  });
}
