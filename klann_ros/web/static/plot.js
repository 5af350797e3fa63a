'use strict';
/* Charts by uPlot in their figures, and their axes: linear ones, and those of powers of ten. */

const HEIGHT = 220;
const FONT = '12px system-ui, sans-serif';

/** Make an element with texts or elements in it. */
function make(name, className, ...content) {
  const node = document.createElement(name);
  if (className) node.className = className;
  node.append(...content);
  return node;
}

/** The base of all charts: a title, a plot as wide as its place, and what is below. */
class PlotFigure {
  constructor(holder, className, title, label, ...below) {
    this.canvas = make('div', '');
    this.canvas.setAttribute('role', 'img');
    this.canvas.setAttribute('aria-label', label);
    this.figure = make('figure', className, make('h3', '', title), this.canvas, ...below);
    holder.append(this.figure);
  }

  draw(options, data) {
    this.plot = new uPlot(options, data, this.canvas);
    this.observer = new ResizeObserver(() => this.fit());
    this.observer.observe(this.canvas);
  }

  width() {
    return Math.max(Math.floor(this.canvas.clientWidth), 200);
  }

  height() {
    return HEIGHT;
  }

  fit() {
    const width = this.width();
    if (width !== this.plot.width) this.plot.setSize({ width, height: this.height() });
  }

  redraw() {
    this.fit();
    this.plot.redraw(false, true);
  }

  remove() {
    this.observer.disconnect();
    this.plot.destroy();
    this.figure.remove();
  }
}

function axis(label, size, isLog = false) {
  const filter = isLog
    ? (u, splits) => splits.map((value) => (isPower(value) ? value : null))
    : undefined;
  const line = { stroke: () => themeColour('grid'), width: 1, ...(isLog && { filter }) };
  return {
    label,
    size,
    labelSize: 20,
    labelFont: FONT,
    font: FONT,
    stroke: () => themeColour('quiet'),
    grid: line,
    ticks: { ...line, size: 4 },
    ...(isLog && { filter, values: (u, splits) => splits.map(power) }),
  };
}

function isPower(value) {
  const exponent = Math.log10(value);
  return Math.abs(exponent - Math.round(exponent)) < 1e-9;
}

function power(value) {
  return value === null ? '' : `1e${Math.round(Math.log10(value))}`;
}

/** Return the powers of ten around values, two of them at least. */
function powers(u, min, max) {
  if (!(min > 0)) return [1e-15, 1e-12];
  const low = Math.floor(Math.log10(min));
  return [10 ** low, 10 ** Math.max(Math.ceil(Math.log10(max)), low + 2)];
}
