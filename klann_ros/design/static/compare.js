'use strict';
/* Chosen legs side by side: in motion by one crank, at one scale; their figures; what comes next. */

const TURN_TIME = 3000;

/** What holds all points of a leg, and the path that it is to follow: middle and size [m]. */
function boxOf(leg) {
  const points = [...leg.points.flat(), ...(data.target || [])];
  const [x, y] = [0, 1].map((axis) => {
    const numbers = points.map((point) => point[axis]);
    const [low, high] = [Math.min(...numbers), Math.max(...numbers)];
    return { middle: (low + high) / 2, size: high - low };
  });
  return { x, y };
}

/** The part of the plane around a box, as large as that of the largest one. */
function planeOf(box, boxes) {
  const width = Math.max(...boxes.map(({ x }) => x.size)) / 2;
  const height = Math.max(...boxes.map(({ y }) => y.size)) / 2;
  const [x, y] = [box.x.middle, box.y.middle];
  return planeAround([
    [x - width, y - height],
    [x + width, y + height],
  ]);
}

/** Draw a leg with the path of its foot. */
function drawLeg(svg, leg, plane, hasLetters) {
  const drawing = new Drawing(svg, plane);
  const feet = leg.points.map((pose) => pose[leg.foot]);
  if (data.target) {
    drawing.add('path', 'recorded-path').setAttribute('d', drawing.line(data.target, true));
  }
  drawing.add('path', 'own-path').setAttribute('d', drawing.line(feet, true));
  const onGround = feet.map((point, i) => (leg.stands[i] ? point : null));
  drawing.add('path', 'trail').setAttribute('d', drawing.line(onGround));
  return new DrawnLeg(drawing, leg.shape, { hasLetters });
}

function tableOf(heads, rows, caption) {
  const table = make('table');
  const head = table.createTHead().insertRow();
  for (const heading of heads) {
    const cell = make('th');
    cell.scope = 'col';
    cell.append(...[heading].flat());
    head.append(cell);
  }
  const body = table.createTBody();
  for (const [first, ...cells] of rows) {
    const row = body.insertRow();
    const heading = make('th');
    heading.scope = 'row';
    heading.append(...[first].flat());
    row.append(heading);
    for (const cell of cells) row.insertCell().append(...[cell].flat());
  }
  const scrolls = make('div', '', 'scrolls');
  scrolls.tabIndex = 0;
  scrolls.setAttribute('role', 'region');
  scrolls.setAttribute('aria-label', caption);
  scrolls.append(table);
  return scrolls;
}

/** The figure of a leg, and that of the search where it differs. */
function reachedText(leg, figure) {
  const reached = leg.figures[figure.name];
  if (reached === undefined) return '–';
  const text = figureText(figure, reached);
  const expected = figureText(figure, leg.expected[figure.name] ?? reached);
  return text === expected ? text : `${text}, expected ${expected}`;
}

class Comparison {
  constructor(place) {
    this.drawn = [];
    this.part = 0;
    this.isMoving = !matchMedia('(prefers-reduced-motion: reduce)').matches;
    this.place = place;
    this.cards = make('div', '', 'chosen');
    this.details = make('div');
    place.append(this.controls(), this.cards, this.details);
    let last = 0;
    const step = (now) => {
      if (this.isMoving) this.go((this.part + (now - last) / TURN_TIME) % 1);
      last = now;
      requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  }

  controls() {
    const bar = make('div', '', 'bar');
    const button = make('button');
    button.type = 'button';
    const say = () => {
      button.textContent = this.isMoving ? 'Stop' : 'Move';
    };
    say();
    button.addEventListener('click', () => {
      this.isMoving = !this.isMoving;
      say();
    });
    this.crank = make('input');
    Object.assign(this.crank, { type: 'range', min: 0, max: 359, value: 0 });
    this.crank.addEventListener('input', () => {
      this.isMoving = false;
      say();
      this.go(Number(this.crank.value) / 360);
    });
    const label = make('label', 'Crank ');
    this.angle = make('span', '0 deg', 'angle');
    label.append(this.crank, this.angle);
    bar.append(make('h2', 'In motion'), button, label);
    return bar;
  }

  /** Show legs by their numbers. */
  show(chosen) {
    const legs = chosen.map((n) => data.legs[n]);
    this.place.hidden = !legs.length;
    const boxes = legs.map(boxOf);
    for (const { walker } of this.drawn) walker?.dispose();
    this.cards.replaceChildren();
    this.drawn = legs.map((leg, k) => this.card(leg, planeOf(boxes[k], boxes)));
    this.details.replaceChildren(this.figures(legs), make('h2', 'Next'), ...legs.map(nextSteps));
    const folder = folderCommand();
    if (folder) this.details.querySelector('h2').after(folder);
    this.go(this.part);
  }

  card(leg, plane) {
    const card = make('div', '', 'card');
    const svg = document.createElementNS(SVG, 'svg');
    svg.setAttribute('role', 'img');
    svg.setAttribute('aria-label', `${leg.name} in motion`);
    svg.classList.add('drawing');
    const details = make('details');
    details.append(make('summary', 'Margins: it turns fully from, to [m, rad]'));
    const margins = Object.entries(leg.margins).map(([name, limits]) => [
      name,
      ...limits.map((limit) => (limit === null ? 'any' : String(Number(limit.toPrecision(5))))),
    ]);
    details.append(tableOf(['dimension', 'from', 'to'], margins, `Margins of ${leg.name}`));
    card.append(make('h3', legTitle(leg)), make('p', leg.linkage, 'quiet'), svg);
    const walker = leg.walker ? new WalkerView(card, leg) : null;
    card.append(details);
    this.cards.append(card);
    return { leg, walker, shown: drawLeg(svg, leg, plane, true) };
  }

  /** The table of all figures: the best is named where several legs are compared. */
  figures(legs) {
    const rows = [];
    for (const figure of data.figures) {
      const texts = legs.map((leg) => reachedText(leg, figure));
      if (texts.every((text) => text === '–')) continue;
      const losses = legs.map((leg) => (figure.sense ? lossOf(leg, figure) : Infinity));
      const best = texts[losses.indexOf(Math.min(...losses))];
      const hasBest = figure.sense && figure.sense !== 'any' && new Set(texts).size > 1;
      const cells = texts.map((text) =>
        hasBest && text === best ? [`${text} `, make('strong', 'best', 'best')] : text,
      );
      rows.push([[`${words(figure.name)} `, make('small', figure.text)], ...cells]);
    }
    return tableOf(['Figure', ...legs.map(legTitle)], rows, 'Figures of the chosen legs');
  }

  go(part) {
    this.part = part;
    const degrees = Math.floor(part * 360);
    this.crank.value = degrees;
    this.angle.textContent = `${degrees} deg`;
    for (const { leg, walker, shown } of this.drawn) {
      walker?.go(part);
      shown.show(leg.points[Math.floor(part * leg.points.length)]);
    }
  }
}

function nextSteps(leg) {
  const steps = make('div', '', 'next');
  steps.append(make('h3', legTitle(leg)));
  for (const name of [leg.name, ...(leg.walker ? [`${leg.name}_walker`] : [])]) {
    const file = make('a', `${name}.yaml`);
    file.href = file.textContent;
    steps.append(file, ' ');
  }
  steps.append(...leg.commands.map(([name, line]) => command(name, line)));
  return steps;
}

/** How a shell gets into the folder of this page; null where it is on a server. */
function folderCommand() {
  if (location.protocol !== 'file:') return null;
  const folder = decodeURIComponent(location.pathname).replace(/[^/]*$/, '');
  const path = /^\/[A-Za-z]:/.test(folder) ? `"${folder.slice(1)}"` : quoted(folder);
  return command('In a terminal', `cd ${path}`);
}

/** A word of a shell. */
function quoted(text) {
  return /^[\w@%+=:,./-]+$/.test(text) ? text : `'${text.replaceAll("'", `'"'"'`)}'`;
}

/** A command with a button that copies it. */
function command(name, line) {
  const row = make('p', '', 'command');
  const code = make('code', line);
  const button = make('button', 'Copy');
  button.type = 'button';
  button.setAttribute('aria-label', `Copy: ${name}`);
  const status = make('span', '', 'quiet');
  status.setAttribute('role', 'status');
  button.addEventListener('click', async () => {
    status.textContent = (await copied(line, code)) ? 'Copied' : 'Selected: press Ctrl-C';
  });
  row.append(make('span', name), code, button, status);
  return row;
}

/** Copy a text, or select it where the browser refuses; return whether it was copied. */
async function copied(text, node) {
  try {
    await navigator.clipboard.writeText(text);
    return true;
  } catch {
    getSelection().selectAllChildren(node);
    return document.execCommand('copy');
  }
}
