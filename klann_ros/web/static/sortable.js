'use strict';
/* Tables that are sorted by a click on a heading, and whose rows are chosen by fields above. */

class SortableTable {
  constructor(table) {
    this.body = table.tBodies[0];
    this.rows = [...this.body.rows];
    this.headings = [...table.tHead.rows[0].cells];
    this.headings.forEach((heading, column) => {
      heading.querySelector('button').addEventListener('click', () => this.sort(column));
    });
    this.filters = table.closest('section').querySelector('.filters');
    if (!this.filters) return;
    this.filters.hidden = false;
    this.filters.addEventListener('input', () => this.filter());
    this.filter();
  }

  /** Sort by a column; a second time the other way round. Unknown numbers are always last. */
  sort(column) {
    const heading = this.headings[column];
    const isDescending = heading.getAttribute('aria-sort') === 'ascending';
    for (const neighbour of this.headings) neighbour.removeAttribute('aria-sort');
    heading.setAttribute('aria-sort', isDescending ? 'descending' : 'ascending');
    const sign = isDescending ? -1 : 1;
    this.rows.sort((row, next) => {
      const text = row.cells[column].textContent.trim();
      const nextText = next.cells[column].textContent.trim();
      const isUnknown = text === '–' || !text;
      const isNextUnknown = nextText === '–' || !nextText;
      if (isUnknown || isNextUnknown) return isUnknown - isNextUnknown;
      return sign * compareCells(text, nextText);
    });
    this.body.append(...this.rows);
  }

  /** Show the rows that contain the text, and have the chosen verdict and check. */
  filter() {
    const wanted = {};
    for (const field of this.filters.querySelectorAll('[data-filter]')) {
      wanted[field.dataset.filter] = field.value;
    }
    let shown = 0;
    for (const row of this.rows) {
      const { verdict, checks } = row.querySelector('[data-verdict]').dataset;
      const isShown =
        row.textContent.toLowerCase().includes(wanted.text.trim().toLowerCase()) &&
        (!wanted.verdict || verdict === wanted.verdict) &&
        (!wanted.checks || checks.split(' ').includes(wanted.checks));
      row.hidden = !isShown;
      shown += isShown;
    }
    const status = this.filters.querySelector('[data-shown]');
    status.textContent = `${shown} of ${this.rows.length} ${status.dataset.shown} shown`;
  }
}

/** Compare numbers as numbers, and texts in the order of their numbers: run2 before run10. */
function compareCells(text, nextText) {
  const difference = Number(text.replaceAll(',', '')) - Number(nextText.replaceAll(',', ''));
  if (!Number.isNaN(difference)) return difference;
  return text.localeCompare(nextText, 'en', { numeric: true });
}

for (const table of document.querySelectorAll('table.sortable')) new SortableTable(table);
