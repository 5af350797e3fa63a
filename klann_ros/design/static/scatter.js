'use strict';
/* The legs by their aims: a scatter of two figures, or bars of a single aim. */

const CHART = { height: 200, left: 58, right: 18, top: 28, bottom: 36 };

function make(name, content = '', className = '') {
  const node = document.createElement(name);
  node.textContent = content;
  if (className) node.className = className;
  return node;
}

function svgNode(name, attributes, parent) {
  const node = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
  parent.append(node);
  return node;
}

/** Round numbers within two. */
function roundNumbers(low, high) {
  const rough = (high - low) / 5;
  const power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].map((n) => n * power).find((n) => n >= rough);
  const numbers = [];
  for (let k = Math.ceil(low / step); k <= high / step + 1e-9; k += 1) numbers.push(k * step);
  return numbers;
}

/** The range of values, with a margin. */
function rangeOf(values) {
  const [low, high] = [Math.min(...values), Math.max(...values)];
  const margin = 0.06 * (high - low) || 0.05 * Math.abs(high) || 1;
  return [low - margin, high + margin];
}

function words(name) {
  return name.replaceAll('_', ' ');
}

function axisTitle(figure) {
  return figure.unit ? `${words(figure.name)} / ${figure.unit}` : words(figure.name);
}

/** Name a leg by its file and its title. */
function legTitle(leg) {
  return [leg.name, leg.title].filter(Boolean).join(', ');
}

/** A figure in its unit, as a number; and with it, as a text. */
function inUnit(figure, value) {
  return Number((value / figure.size).toPrecision(4));
}

function figureText(figure, value) {
  return `${inUnit(figure, value)} ${figure.unit}`.trim();
}

/** By how much a leg misses the aim of a figure; infinite where it has none. */
function lossOf(leg, { name, sense, value }) {
  const figure = leg.figures[name] ?? Infinity;
  if (sense === 'near') return Math.abs(figure - value);
  return sense === 'maximize' && name in leg.figures ? -figure : figure;
}

class Scatter {
  constructor(place, bar, figures, choose) {
    this.place = place;
    this.choose = choose;
    this.chosen = [];
    this.svg = svgNode('svg', { role: 'group', 'aria-label': 'Scatter of the legs' }, place);
    this.axes = ['x', 'y'].map((axis, k) => {
      const select = document.createElement('select');
      figures.forEach((figure, n) => select.append(new Option(axisTitle(figure), n)));
      select.value = String(k);
      select.addEventListener('change', () => this.draw());
      const label = make('label', axis);
      label.append(select);
      bar.append(label);
      return () => figures[Number(select.value)];
    });
    // The text keeps its size where the place is narrow.
    new ResizeObserver(() => this.draw()).observe(place);
  }

  draw() {
    const [x, y] = this.axes.map((axis) => axis());
    const width = this.place.clientWidth - 24;
    this.svg.replaceChildren();
    this.svg.setAttribute('viewBox', `0 0 ${width} ${CHART.height}`);
    const right = width - CHART.right;
    const floor = CHART.height - CHART.bottom;
    const at = (leg, { name, size }) => leg.figures[name] / size;
    const [rangeX, rangeY] = [x, y].map((axis) => rangeOf(data.legs.map((leg) => at(leg, axis))));
    const part = (value, [low, high]) => (value - low) / (high - low);
    const toX = (value) => CHART.left + part(value, rangeX) * (right - CHART.left);
    const toY = (value) => floor - part(value, rangeY) * (floor - CHART.top);
    for (const value of roundNumbers(...rangeX)) {
      svgNode('path', { class: 'grid', d: `M${toX(value)} ${CHART.top}V${floor}` }, this.svg);
      this.label(value, toX(value), floor + 14, 'middle');
    }
    for (const value of roundNumbers(...rangeY)) {
      svgNode('path', { class: 'grid', d: `M${CHART.left} ${toY(value)}H${right}` }, this.svg);
      this.label(value, CHART.left - 6, toY(value) + 4, 'end');
    }
    this.text(axisTitle(x), (CHART.left + right) / 2, CHART.height - 4, 'middle');
    this.text(axisTitle(y), 4, 12, 'start');
    this.dots = data.legs.map((leg, n) => {
      const place = { cx: toX(at(leg, x)), cy: toY(at(leg, y)), r: 7 };
      const dot = svgNode('circle', { ...place, tabindex: 0, role: 'button' }, this.svg);
      dot.setAttribute('aria-label', legTitle(leg));
      svgNode('title', {}, dot).textContent = legTitle(leg);
      dot.addEventListener('click', () => this.choose(n));
      dot.addEventListener('keydown', (event) => {
        if (event.key !== 'Enter' && event.key !== ' ') return;
        event.preventDefault();
        this.choose(n);
      });
      const number = String(Number(leg.name.split('_')[1]));
      this.text(number, place.cx, place.cy - 10, 'middle').setAttribute('aria-hidden', 'true');
      return dot;
    });
    this.mark(this.chosen);
  }

  label(value, x, y, anchor) {
    this.text(String(Number(value.toPrecision(6))), x, y, anchor);
  }

  text(content, x, y, anchor) {
    const node = svgNode('text', { x, y, 'text-anchor': anchor }, this.svg);
    node.textContent = content;
    return node;
  }

  mark(chosen) {
    this.chosen = chosen;
    this.dots?.forEach((dot, n) => dot.setAttribute('aria-pressed', String(chosen.includes(n))));
  }
}

/** Bars of the only aim, and by how much each leg is behind the best. */
class AimBars {
  constructor(place, figure, choose) {
    const sizes = data.legs.map((leg) => Math.abs(leg.figures[figure.name]));
    const losses = data.legs.map((leg) => lossOf(leg, figure));
    const best = Math.min(...losses);
    this.buttons = data.legs.map((leg, n) => {
      const button = make('button', '', 'aim-bar');
      button.type = 'button';
      const bar = make('span', '', 'length');
      bar.style.setProperty('--part', sizes[n] / (Math.max(...sizes) || 1));
      const behind = `${figureText(figure, losses[n] - best)} behind`;
      const text = figureText(figure, leg.figures[figure.name]);
      button.append(make('span', leg.name), bar, make('span', text));
      button.append(make('small', losses[n] === best ? 'the best' : behind));
      button.addEventListener('click', () => choose(n));
      place.append(button);
      return button;
    });
    place.classList.add('aim-bars');
  }

  mark(chosen) {
    this.buttons.forEach((button, n) => {
      button.setAttribute('aria-pressed', String(chosen.includes(n)));
    });
  }
}
