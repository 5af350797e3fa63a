'use strict';
/* The names of a chart's lines, with their values at the pointer or at the shown time. */

/** The names of a chart's lines, with their values; buttons that hide them. */
class Legend {
  constructor(settings, onToggle) {
    this.settings = settings;
    this.node = make('div', 'legend');
    this.values = settings.lines.map((line, i) => this.entry(line, i, onToggle));
  }

  entry(line, i, onToggle) {
    const value = make('span', 'value');
    const button = make('button', '', swatch(line), line.name, value);
    button.type = 'button';
    button.setAttribute('aria-pressed', String(!line.isHidden));
    button.addEventListener('click', () => {
      const isShown = button.getAttribute('aria-pressed') !== 'true';
      button.setAttribute('aria-pressed', String(isShown));
      onToggle(i, isShown);
    });
    this.node.append(button);
    return value;
  }

  /** Show the values under the pointer, or else at the shown time. */
  showAt(plot, x) {
    const under = plot.cursor && plot.cursor.left >= 0 ? plot.cursor.idx : null;
    const index = under === null || under === undefined ? nearestIn(plot.data[0], x) : under;
    this.values.forEach((node, i) => {
      node.textContent = this.text(plot.data, i, index);
    });
  }

  text(data, line, index) {
    if (index < 0 || !this.settings.data[0].length) return '';
    if (!this.settings.isBand) return number(nearby(data[line + 1], index), this.settings);
    const [low, high] = [data[2 * line + 1][index], data[2 * line + 2][index]];
    const [first, last] = [number(low, this.settings), number(high, this.settings)];
    return first === last ? first : `${first} … ${last}`;
  }
}

/** Return the value at an index; of two runs' columns, whose times differ, the one before. */
function nearby(column, index) {
  let at = index;
  while (at > 0 && column[at] === undefined) at -= 1;
  return column[at];
}

function number(value, settings) {
  if (!Number.isFinite(value)) return '–';
  return settings.isLog ? value.toExponential(1) : fixedText(value, settings.digits);
}

/** Return the names of lines beside their colours and dashes. */
function namesOf(lines) {
  const names = lines.map(({ name, colour, dash }) => {
    const mark = swatch({ colour: 0, dash });
    mark.firstChild.setAttribute('class', `ink-${colour}`);
    return make('span', '', mark, name);
  });
  return make('div', 'legend', ...names);
}

function swatch(line) {
  const svg = document.createElementNS(SVG, 'svg');
  const path = document.createElementNS(SVG, 'path');
  svg.setAttribute('viewBox', '0 0 26 8');
  svg.setAttribute('aria-hidden', 'true');
  path.setAttribute('d', 'M1 4H25');
  path.setAttribute('class', `colour-${line.colour % BODY_COLOURS}`);
  path.setAttribute('stroke-dasharray', line.dash.join(' '));
  svg.append(path);
  return svg;
}
