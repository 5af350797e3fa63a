'use strict';
/* What the linkage does here at a rate of its crank, and a whole turn as a table. */

/** Return a quantity in the page's unit, without it. */
function shownQuantity(value, kind) {
  if (Number.isNaN(value)) return '–';
  const [, , scale, digits] = KINDS[kind];
  const size = Math.abs(scale * value);
  if (size === Infinity) return '∞';
  return size < 1e7 ? decimals(scale * value, digits) : inLocale((scale * value).toExponential(3));
}

/** Return the bar by whose direction a body's angle is told, or the line that it slides along. */
function barOf({ bars: [{ from, to }] }) {
  return from + to;
}

function cellOf(name, text, scope) {
  const cell = made(name, '', text);
  if (scope) cell.scope = scope;
  return cell;
}

function headOf(names) {
  const head = made('thead');
  const row = made('tr');
  row.append(...names.map((name) => cellOf('th', name, 'col')));
  head.append(row);
  return head;
}

class ValuesPanel {
  constructor(lab, curves) {
    Object.assign(this, { lab, curves });
    lab.on('linkage', () => this.build());
    for (const event of ['numbers', 'pose']) lab.on(event, () => this.show());
    this.field = new DecimalField(lab, {
      id: 'rate',
      unit: 'rad/s',
      value: () => lab.rate,
      take: (rate) => lab.setRate(rate),
    });
    byId('rate-field').append(this.field.input);
    byId('rate-field').after(this.field.reason);
  }

  /** Lay out a row for each body, point and dyad, whose cells are its quantities in order. */
  build() {
    const { linkage } = this.lab;
    const { bodies } = linkage.structure;
    const groups = { bodies: new Map(), points: new Map(), dyads: new Map() };
    const rowOf = (rows, key, name, about) => {
      if (!rows.has(key)) {
        const row = made('tr');
        const head = cellOf('th', `${name} `, 'row');
        head.append(made('span', 'quiet', about));
        row.append(head);
        rows.set(key, row);
      }
      return rows.get(key);
    };
    this.cells = quantitiesOf(linkage).map((quantity) => {
      const { body, point, dyad, key, name } = quantity;
      const row =
        body !== undefined
          ? rowOf(groups.bodies, body, name, barOf(bodies[body]))
          : point
            ? rowOf(groups.points, point, point, '')
            : rowOf(groups.dyads, dyad, key, name || say('coupled'));
      const cell = made('td');
      cell.addEventListener('click', () => this.curves.put(key));
      row.append(cell);
      return { cell, quantity };
    });
    const crank = [made('td'), made('td'), made('td')];
    groups.bodies.get(0).append(...crank);
    this.crank = crank;
    const unit = (end) => {
      const kinds = bodies.map(({ slides }) => (slides ? 'length' : 'angle') + end);
      return [...new Set(kinds)].map((kind) => KINDS[kind][1]).join(', ');
    };
    const heads = {
      bodies: [
        say('body'),
        `${say('angle')} [${unit('')}]`,
        `${say('velocity')} [${unit('_rate')}]`,
        `${say('acceleration')} [${unit('_acceleration')}]`,
        `${say('advantage')} [${unit('_advantage')}]`,
      ],
      points: [
        say('pointName'),
        ...['x', 'y', 'vx', 'vy', 'ax', 'ay'].map(
          (name, n) => `${name} [${['mm', 'mm/s', 'mm/s²'][n >> 1]}]`,
        ),
      ],
      dyads: [say('dyadName'), `${say('angle')} [°]`],
    };
    for (const [group, rows] of Object.entries(groups)) {
      const body = made('tbody');
      body.append(...rows.values());
      byId(`values-${group}`).replaceChildren(headOf(heads[group]), body);
    }
    this.show();
  }

  show() {
    const { linkage, pose, rate } = this.lab;
    if (!this.cells) return;
    this.field.show();
    byId('rpm').textContent = `= ${decimals((rate * 60) / TAU, 2)} rpm`;
    const state = stateOf(linkage, pose, rate);
    for (const { cell, quantity } of this.cells) {
      const { kind, of } = quantity;
      let value = state ? of(state) : NaN;
      if (quantity.body === 0) value = modulo(this.lab.alpha, TAU);
      const text = shownQuantity(value, kind);
      if (cell.textContent !== text) cell.textContent = text;
    }
    [rate, 0, 1].forEach((value, n) => {
      this.crank[n].textContent = decimals(value, 4);
    });
  }
}

/** A turn as a table, which is shown, copied and saved in the same columns. */
class TurnTable {
  constructor(lab) {
    this.lab = lab;
    lab.on('turn', () => this.soon());
    byId('table-step').append(
      ...[1, 2, 5, 6, 10, 15, 30, 45].map((step) => new Option(`${step}°`, step)),
    );
    byId('table-step').value = '30';
    for (const id of ['table-step', 'table-rates'])
      byId(id).addEventListener('change', () => this.show());
    byId('table-copy').addEventListener('click', () => this.copy());
  }

  /** Fill it when nothing moves. */
  soon() {
    clearTimeout(this.waiting);
    this.waiting = setTimeout(() => this.show(), 250);
  }

  get columns() {
    const hasRates = byId('table-rates').checked;
    return quantitiesOf(this.lab.linkage).filter(({ order }) => hasRates || !order);
  }

  get rows() {
    const { linkage, rate } = this.lab;
    return turnRows(linkage, this.columns, Number(byId('table-step').value), rate);
  }

  show() {
    const { columns } = this;
    const heads = columns.map(({ key, kind }) => `${key} [${KINDS[kind][1]}]`);
    const body = made('tbody');
    body.append(
      ...this.rows.map((row) => {
        const line = made('tr');
        line.append(
          ...row.map((value, n) => {
            const text = shownQuantity(value / KINDS[columns[n].kind][2], columns[n].kind);
            return n ? made('td', '', text) : cellOf('th', text, 'row');
          }),
        );
        return line;
      }),
    );
    byId('turn-table').replaceChildren(headOf(heads), body);
    byId('table-note').textContent = '';
  }

  text(separator) {
    return csvOf(this.columns, this.rows, language.now === 'pt', separator);
  }

  async copy() {
    let note = 'tableCopied';
    try {
      await navigator.clipboard.writeText(this.text('\t'));
    } catch {
      // Not allowed, or no secure context.
      note = 'tableNotCopied';
    }
    byId('table-note').textContent = say(note);
  }
}
