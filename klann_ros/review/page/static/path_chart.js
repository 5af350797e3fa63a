'use strict';
/* The path of the foot in the plane, equally scaled in x and y: recorded, and by the geometry. */

// Of the plot, at most.
const PATH_HEIGHT = 380;
// Both scales are set together.
const exactly = (u, min, max) => [min, max];
const inMillimetres = (u, splits) => splits.map((metres) => Number((1000 * metres).toPrecision(6)));

class PathChart extends DescribedFigure {
  /** Make the chart for legs, one of each run; `onPick` gets the time of the row clicked at. */
  constructor(holder, legs, onPick) {
    const text = legs
      .map((leg, run) => `${legs.length > 1 ? `${'AB'[run]}: ` : ''}${leg.texts.path}`)
      .join(' ');
    super(holder, 'chart', 'Path of the foot', text);
    this.legs = legs;
    this.lines = legs.flatMap((leg, run) => pathLines(leg, run, legs.length > 1));
    this.extent = extentOf(this.lines);
    this.canvas.before(namesOf(this.lines));
    this.draw(this.options(), [null, ...this.lines.map((line) => line.data)]);
    this.now = make('div', 'now-point');
    this.hover = make('output', 'hover');
    this.plot.over.append(this.now, this.hover);
    this.row = -1;
    pickByClick(this.plot, () => this.pick(onPick));
    this.showAll();
  }

  options() {
    return {
      mode: 2,
      width: this.width(),
      height: this.height(),
      padding: [12, 12, 0, 0],
      legend: { show: false },
      cursor: {
        drag: { x: true, y: true, setScale: false },
        points: { show: false },
        dataIdx: () => null,
        bind: { dblclick: () => () => this.showAll() },
      },
      scales: {
        x: { time: false, auto: false, range: exactly },
        y: { auto: false, range: exactly },
      },
      axes: [
        { ...axis('x / mm', 28), values: inMillimetres },
        { ...axis('y / mm', 52), values: inMillimetres },
      ],
      series: [
        {},
        ...this.lines.map((line) => ({
          label: line.name,
          stroke: () => themeColour(line.colour),
          paths: (u, index) =>
            (this.lines[index - 1].isDots ? paintDots : paintLine)(u, this.lines[index - 1]),
          facets: [
            { scale: 'x', auto: false },
            { scale: 'y', auto: false },
          ],
        })),
      ],
      hooks: {
        setSelect: [(u) => this.zoomTo(u.select)],
        setCursor: [(u) => this.showUnder(u)],
        setScale: [() => this.moveNow()],
      },
    };
  }

  /** Show a box of the plane [m], widened to the plot's shape. */
  view({ left, right, bottom, top }) {
    const { width, height } = this.plot.bbox;
    const metres = Math.max((right - left) / width, (top - bottom) / height) || 1e-3;
    const [x, y] = [(left + right) / 2, (bottom + top) / 2];
    this.plot.batch(() => {
      this.plot.setScale('x', { min: x - (metres * width) / 2, max: x + (metres * width) / 2 });
      this.plot.setScale('y', { min: y - (metres * height) / 2, max: y + (metres * height) / 2 });
    });
  }

  zoomTo({ left, top, width, height }) {
    if (width < 5 || height < 5) return;
    const at = (position, scale) => this.plot.posToVal(position, scale);
    this.view({
      left: at(left, 'x'),
      right: at(left + width, 'x'),
      bottom: at(top + height, 'y'),
      top: at(top, 'y'),
    });
    this.plot.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
  }

  showAll() {
    this.view(this.extent);
  }

  /** Say which recorded foot is nearest to the pointer. */
  showUnder(u) {
    const { left, top } = u.cursor;
    this.row =
      left >= 0 ? nearestFoot(this.legs[0], u.posToVal(left, 'x'), u.posToVal(top, 'y')) : -1;
    const at = this.row >= 0 ? this.legs[0].footAt(this.row) : null;
    this.hover.textContent = at
      ? `${this.legs[0].times[this.row].toFixed(3)} s: ${positionText(at)}`
      : '';
  }

  pick(onPick) {
    if (this.row >= 0) onPick(this.legs[0].times[this.row]);
  }

  /** Mark the foot at a row. */
  mark(row) {
    this.at = row >= 0 ? this.legs[0].footAt(row) : null;
    this.moveNow();
  }

  moveNow() {
    if (!this.now) return;
    this.now.hidden = !this.at;
    if (!this.at) return;
    const [x, y] = [this.plot.valToPos(this.at[0], 'x'), this.plot.valToPos(this.at[1], 'y')];
    this.now.style.transform = `translate(${x}px, ${y}px)`;
  }

  height() {
    return Math.min(PATH_HEIGHT, Math.round(0.85 * this.width()) + 40);
  }

  fit() {
    if (this.width() === this.plot.width) return;
    super.fit();
    this.showAll();
  }
}
