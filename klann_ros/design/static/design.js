'use strict';
/* The page of a search: legs are chosen in the list or the chart, and compared. */

// Without legs there is no data.
const data = JSON.parse(document.getElementById('data')?.textContent ?? 'null');
const MAX_CHOSEN = 4;

class DesignPage {
  constructor() {
    this.chosen = [];
    this.comparison = new Comparison(document.querySelector('.compare'));
    const choose = (n) => this.toggle(n);
    const place = document.querySelector('.choice');
    this.picked = make('span');
    this.picked.setAttribute('role', 'status');
    const hint = make('p', 'Choose up to four: they move side by side below. ', 'quiet');
    hint.append(this.picked);
    hint.hidden = data.legs.length === 1;
    const bar = make('div', '', 'bar axes');
    bar.append(make('h2', 'Legs'), hint);
    const chart = make('div', '', 'scatter card');
    place.append(bar, chart, this.list(choose));
    new SortableTable(place.querySelector('table'));
    this.chart = this.newChart(chart, bar, choose);
    data.legs.slice(0, 2).forEach((_, n) => choose(n));
  }

  /** The table of the legs: a button that chooses each, and the figures of the requirements. */
  list(choose) {
    const figures = data.figures.filter(({ sense }) => sense);
    const hasNames = new Set(data.legs.map((leg) => leg.linkage)).size > 1;
    const heads = ['Leg', ...figures.map(axisTitle)].map((text) => [make('button', text)]);
    this.buttons = [];
    const rows = data.legs.map((leg, n) => {
      const button = make('button');
      button.addEventListener('click', () => choose(n));
      const svg = svgNode('svg', { 'aria-hidden': 'true', class: 'thumbnail' }, button);
      const box = boxOf(leg);
      drawLeg(svg, leg, planeOf(box, [box]), false).show(leg.points[0]);
      const title = make('span');
      title.append(make('b', `${leg.name} `), leg.title);
      button.append(title);
      if (hasNames) button.append(make('small', leg.linkage));
      this.buttons.push(button);
      const cells = figures.map((figure) =>
        figure.name in leg.figures ? String(inUnit(figure, leg.figures[figure.name])) : '–',
      );
      return [[button], ...cells];
    });
    const list = tableOf(heads, rows, 'All legs');
    list.firstChild.classList.add('sortable');
    for (const row of list.firstChild.tBodies[0].rows) {
      figures.forEach((figure, k) => {
        row.cells[k + 1].dataset.head = axisTitle(figure);
      });
    }
    return list;
  }

  newChart(place, bar, choose) {
    const isKnown = ({ name, sense }) => sense && data.legs.every((leg) => name in leg.figures);
    const figures = data.figures.filter(isKnown);
    place.hidden = data.legs.length < 2 || figures.length < 2;
    if (place.hidden) return null;
    const isAim = data.aimCount === 1 && figures[0] === data.figures[0];
    return isAim ? new AimBars(place, figures[0], choose) : new Scatter(place, bar, figures, choose);
  }

  toggle(n) {
    if (this.chosen.includes(n)) this.chosen = this.chosen.filter((k) => k !== n);
    else this.chosen = [...this.chosen, n].slice(-MAX_CHOSEN);
    this.comparison.show(this.chosen);
    this.chart?.mark(this.chosen);
    this.buttons.forEach((button, k) => {
      button.setAttribute('aria-pressed', String(this.chosen.includes(k)));
    });
    const names = this.chosen.map((k) => data.legs[k].name).join(', ') || 'none';
    this.picked.textContent = `Chosen: ${names}.`;
  }
}

const designPage = data && new DesignPage();
