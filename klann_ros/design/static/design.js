'use strict';
/* The scatter of the aims, and up to four chosen legs in motion. */

// Without legs there is no data.
const data = JSON.parse(document.getElementById('data')?.textContent ?? 'null');
const TURN_TIME = 3000;
const MAX_CHOSEN = 4;
const SIZE = { width: 560, height: 340, left: 62, right: 14, top: 28, bottom: 42 };

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
  const found = [];
  for (let k = Math.ceil(low / step); k <= high / step + 1e-9; k += 1) found.push(k * step);
  return found;
}

/** The range of values, with a margin. */
function rangeOf(values) {
  const [low, high] = [Math.min(...values), Math.max(...values)];
  const margin = 0.06 * (high - low) || 0.05 * Math.abs(high) || 1;
  return [low - margin, high + margin];
}

class Scatter {
  constructor(place, choose) {
    const box = `0 0 ${SIZE.width} ${SIZE.height}`;
    this.svg = svgNode('svg', { viewBox: box, role: 'group', 'aria-label': 'The legs' }, place);
    this.choose = choose;
    this.dots = [];
  }

  show(x, y, chosen) {
    this.svg.replaceChildren();
    const ranges = [x, y].map((axis) => rangeOf(data.legs.map((leg) => leg.figures[axis.name])));
    const right = SIZE.width - SIZE.right;
    const floor = SIZE.height - SIZE.bottom;
    const part = (value, [low, high]) => (value - low) / (high - low);
    const toX = (value) => SIZE.left + part(value, ranges[0]) * (right - SIZE.left);
    const toY = (value) => floor - part(value, ranges[1]) * (floor - SIZE.top);
    for (const value of roundNumbers(...ranges[0])) {
      svgNode('path', { class: 'grid', d: `M${toX(value)} ${SIZE.top}V${floor}` }, this.svg);
      this.label(value, toX(value), floor + 16, 'middle');
    }
    for (const value of roundNumbers(...ranges[1])) {
      svgNode('path', { class: 'grid', d: `M${SIZE.left} ${toY(value)}H${right}` }, this.svg);
      this.label(value, SIZE.left - 6, toY(value) + 4, 'end');
    }
    this.text(titleOf(x), (SIZE.left + right) / 2, SIZE.height - 6, 'middle');
    this.text(titleOf(y), 4, 12, 'start');
    this.dots = data.legs.map((leg, n) => {
      const at = { cx: toX(leg.figures[x.name]), cy: toY(leg.figures[y.name]), r: 7 };
      const dot = svgNode('circle', { ...at, tabindex: 0, role: 'button' }, this.svg);
      dot.setAttribute('aria-label', leg.name);
      svgNode('title', {}, dot).textContent = `${leg.name}, ${leg.linkage}`;
      dot.addEventListener('click', () => this.choose(n));
      dot.addEventListener('keydown', (event) => {
        if (event.key !== 'Enter' && event.key !== ' ') return;
        event.preventDefault();
        this.choose(n);
      });
      return dot;
    });
    this.mark(chosen);
  }

  label(value, x, y, anchor) {
    this.text(String(Number(value.toPrecision(6))), x, y, anchor);
  }

  text(content, x, y, anchor) {
    svgNode('text', { x, y, 'text-anchor': anchor }, this.svg).textContent = content;
  }

  mark(chosen) {
    this.dots.forEach((dot, n) => dot.setAttribute('aria-pressed', String(chosen.includes(n))));
  }
}

function titleOf(axis) {
  const name = axis.name.replaceAll('_', ' ');
  return axis.unit ? `${name} / ${axis.unit}` : name;
}

/** A chosen leg: its drawing, figures and margins. */
class LegCard {
  constructor(leg, place) {
    this.leg = leg;
    this.node = make('div', '', 'card');
    place.append(this.node);
    this.node.append(make('h3', `${leg.name}, ${leg.linkage}`));
    const svg = document.createElementNS(SVG, 'svg');
    svg.setAttribute('role', 'img');
    svg.setAttribute('aria-label', `${leg.name} in motion`);
    svg.classList.add('drawing');
    this.node.append(svg);
    const target = data.target || [];
    const drawing = new Drawing(svg, planeAround([...leg.points.flat(), ...target]));
    const feet = leg.points.map((pose) => pose[leg.foot]);
    if (target.length) {
      drawing.add('path', 'recorded-path').setAttribute('d', drawing.line(target, true));
    }
    drawing.add('path', 'own-path').setAttribute('d', drawing.line(feet, true));
    const onGround = feet.map((at, i) => (leg.stands[i] ? at : null));
    drawing.add('path', 'trail').setAttribute('d', drawing.line(onGround));
    this.drawn = new DrawnLeg(drawing, leg.shape);
    this.table(['figure', 'expected', 'reached'], leg.rows);
    const details = make('details');
    details.append(make('summary', 'Margins: it turns fully from, to'));
    this.table(['dimension', 'from', 'to'], leg.margins, details);
    this.node.append(details);
    const files = make('p', '', 'quiet');
    files.append(this.link(`${leg.name}.yaml`));
    if (leg.walker) files.append(', ', this.link(`${leg.name}_walker.yaml`));
    files.append(`: describe ${leg.name}.yaml --html sheet.html; export ${leg.name}.yaml --svg plates.svg`);
    this.node.append(files);
    this.go(0);
  }

  link(file) {
    const link = make('a', file);
    link.href = file;
    return link;
  }

  table(heads, rows, place = this.node) {
    const table = make('table');
    const head = table.createTHead().insertRow();
    for (const text of heads) head.append(make('th', text));
    const body = table.createTBody();
    for (const [first, ...others] of rows) {
      const row = body.insertRow();
      const heading = make('th', first);
      heading.scope = 'row';
      row.append(heading, ...others.map((text) => make('td', text)));
    }
    place.append(table);
  }

  go(part) {
    const row = Math.floor(part * this.leg.points.length) % this.leg.points.length;
    this.drawn.show(this.leg.points[row]);
  }
}

class DesignPage {
  constructor() {
    this.chosen = [];
    this.cards = [];
    this.place = document.querySelector('.chosen');
    this.scatter = new Scatter(document.querySelector('.scatter'), (n) => this.toggle(n));
    this.selects = ['x', 'y'].map((axis, k) => {
      const select = document.querySelector(`.axis-${axis}`);
      data.axes.forEach((each, n) => select.append(new Option(titleOf(each), n)));
      select.value = String(Math.min(k, data.axes.length - 1));
      select.addEventListener('change', () => this.draw());
      return select;
    });
    this.draw();
    this.toggle(0);
    const still = matchMedia('(prefers-reduced-motion: reduce)').matches;
    if (!still) requestAnimationFrame((now) => this.move(now));
  }

  draw() {
    const [x, y] = this.selects.map((select) => data.axes[Number(select.value)]);
    this.scatter.show(x, y, this.chosen);
  }

  toggle(n) {
    if (this.chosen.includes(n)) this.chosen = this.chosen.filter((k) => k !== n);
    else this.chosen = [...this.chosen, n].slice(-MAX_CHOSEN);
    this.place.replaceChildren();
    this.cards = this.chosen.map((k) => new LegCard(data.legs[k], this.place));
    this.scatter.mark(this.chosen);
  }

  move(now) {
    for (const card of this.cards) card.go((now % TURN_TIME) / TURN_TIME);
    requestAnimationFrame((next) => this.move(next));
  }
}

if (data) new DesignPage();
