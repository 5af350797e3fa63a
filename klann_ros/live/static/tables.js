'use strict';
/* Lists and tables; untrusted text is inserted as text, never as markup. */

const LEVEL_CLASS = { ok: 'good', warning: 'warning', error: 'error', stale: 'note' };
const LEVEL_MARK = { ok: '✓', warning: '!', error: '×', stale: '…' };
const SERVICE_LABELS = {
  pause: 'Pause', resume: 'Resume', split: 'New file', step: 'One message on', trigger: 'Keep this moment',
};

/** Return the pieces of a name, which may break between them. */
function breakable(name) {
  return name.split(/(?<=_)/).flatMap((piece) => [piece, document.createElement('wbr')]);
}

/** Show the diagnostics; equal ones of several nodes are grouped. */
function showDiagnostics(list, statuses) {
  const groups = new Map();
  for (const status of statuses) {
    const key = JSON.stringify([status.level, status.meaning || status.text]);
    if (!groups.has(key)) groups.set(key, []);
    groups.get(key).push(status);
  }
  const items = [...groups.values()].map((group) => diagnosis(group));
  list.replaceChildren(...(items.length ? items : [make('li', 'quiet', 'No diagnostics yet.')]));
}

function diagnosis(group) {
  const [status] = group;
  const mark = make('span', 'mark', LEVEL_MARK[status.level]);
  mark.setAttribute('role', 'img');
  mark.setAttribute('aria-label', status.level);
  const own = status.meaning && status.level !== 'ok' ? make('em', '', inPageUnits(status.text)) : '';
  const figures = Object.entries(status.figures)
    .filter(([, value]) => !['', '0', 'nan'].includes(value))
    .map(([key, value]) => `${key} ${figureText(key, value)}`);
  const text = make(
    'div',
    '',
    make('b', '', groupName(group)),
    ` ${status.meaning || inPageUnits(status.text)}`,
    own,
    group.length === 1 ? make('em', 'figures', figures.join(' · ')) : '',
  );
  return make('li', LEVEL_CLASS[status.level], mark, text);
}

/** Return a figure of a status in the page's unit. */
function figureText(key, value) {
  const number = Number(value);
  if (!Number.isFinite(number)) return value;
  if (key === 'residual') return `${Number((1000 * number).toPrecision(2))} mm`;
  return key === 'rate' ? `${fixedText(number, 1)} Hz` : value;
}

/** Return the names of a group, with their common part once. */
function groupName(group) {
  const [first, ...others] = group.map((status) => status.name);
  const [node, leg] = first.split(': ');
  if (!leg || others.some((name) => !name.startsWith(`${node}: `))) return [first, ...others].join(', ');
  return `${node}: ${[leg, ...others.map((name) => name.slice(node.length + 2))].join(', ')}`;
}

function showTopics(body, topics) {
  const heads = [...body.parentNode.querySelectorAll('thead th')].map((head) => head.textContent);
  const rows = topics.map((topic) => {
    const head = make('th', '', topic.name);
    head.scope = 'row';
    const silence = topic.latched ? `latched ${topic.silence} s ago` : `silent for ${topic.silence} s`;
    const rate = topic.silence === null ? topic.rate.toFixed(1) : silence;
    const lost = topic.lost === null ? 'unknown' : String(topic.lost);
    const cells = [rate, lost, String(topic.publishers), topic.type];
    const row = make('tr', '', head, ...cells.map((text) => make('td', '', text)));
    [...row.children].forEach((cell, i) => (cell.dataset.head = heads[i]));
    return row;
  });
  body.replaceChildren(...rows);
}

/** A recorder or a player: its state and its buttons. */
class MachineCard {
  constructor(live, machine) {
    this.live = live;
    this.node = machine.node;
    const title = machine.kind === 'recorder' ? 'Recorder' : 'Player';
    this.text = make('p', '');
    this.reply = make('p', 'quiet');
    this.reply.setAttribute('role', 'status');
    this.buttons = machine.services.map((name) => {
      const button = make('button', '', SERVICE_LABELS[name] || name);
      button.type = 'button';
      button.name = name;
      button.addEventListener('click', () => this.request({ command: 'call', name }));
      return button;
    });
    this.card = make(
      'div',
      'card',
      make('h3', '', `${title} ${machine.node}`),
      this.text,
      make('div', 'buttons', ...this.buttons),
      this.reply,
    );
    if (machine.kind === 'player') this.card.insertBefore(this.seek(machine), this.reply);
  }

  seek(machine) {
    const input = make('input', '');
    Object.assign(input, { type: 'range', min: 0, max: machine.length || 1, step: 'any' });
    input.value = machine.position || 0;
    input.disabled = !this.live.mayDrive;
    const output = make('output', '');
    const showPosition = () => (output.textContent = `${Number(input.value).toFixed(2)} s`);
    showPosition();
    input.addEventListener('input', showPosition);
    input.addEventListener('change', () => this.request({ command: 'seek', value: Number(input.value) }));
    this.slider = input;
    this.showPosition = showPosition;
    return make('label', 'slider', 'Go to ', output, input);
  }

  update(machine) {
    // A player does not report whether it is paused.
    const useless = { true: 'pause', false: 'resume' }[machine.paused];
    for (const button of this.buttons) button.disabled = !this.live.mayDrive || button.name === useless;
    if (machine.kind === 'recorder') {
      const counts = 'written' in machine
        ? `${machine.written.toLocaleString('en')} messages written, ${machine.lost.toLocaleString('en')} lost`
        : 'no figures yet';
      const state = machine.paused ? 'Paused' : machine.writes ? 'Recording' : 'Waiting for a moment to keep';
      this.text.textContent = `${state}: ${counts}.`;
    } else {
      const known = (value, unit) => (value === undefined ? '–' : `${value.toFixed(2)} ${unit}`);
      this.text.textContent = `${known(machine.length, 's')} long, at ${known(machine.rate, '×')}; last known position ${known(machine.position, 's')}.`;
      if (this.slider !== document.activeElement) {
        this.slider.max = machine.length || 1;
        this.slider.value = machine.position || 0;
        this.showPosition();
      }
    }
  }

  async request(command) {
    const answer = await this.live.request({ target: this.node, ...command });
    this.reply.textContent = answer.done ? answer.message || 'Done.' : `Refused: ${answer.message}`;
  }
}

/** The lengths of a leg, each a field; a refused value is set back. */
class LengthFields {
  constructor(live, holder, state) {
    this.live = live;
    this.holder = holder;
    this.state = state;
    this.key = '';
    this.fields = new Map();
  }

  update(solver, leg) {
    const lengths = solver ? solver.lengths.filter((one) => one.leg === leg.name && one.unit) : [];
    byId('lengths-section').hidden = !lengths.length;
    const key = JSON.stringify([solver && solver.node, this.live.mayDrive, lengths.map((one) => one.name)]);
    if (key !== this.key) {
      this.key = key;
      this.fields.clear();
      this.holder.replaceChildren(...lengths.map((one) => this.field(solver.node, one)));
      this.state.textContent = this.live.mayDrive
        ? 'A new number takes effect at once; a refusal is shown here.'
        : 'This page may only view.';
    }
    for (const one of lengths) {
      const input = this.fields.get(one.name);
      input.dataset.held = inPageUnit(one.value, one.unit);
      if (input !== document.activeElement) input.value = input.dataset.held;
    }
  }

  field(node, one) {
    const input = make('input', '');
    Object.assign(input, { type: 'number', step: 'any' });
    input.value = inPageUnit(one.value, one.unit);
    input.disabled = !this.live.mayDrive;
    input.addEventListener('change', () => this.set(node, one, input));
    this.fields.set(one.name, input);
    return make('label', '', `${one.name.split('.').pop()} [${PAGE_UNITS[one.unit][0]}]`, input);
  }

  async set(node, { name, unit }, input) {
    // An unfinished number is empty.
    const isNumber = Number.isFinite(input.valueAsNumber);
    const value = inSiUnit(input.valueAsNumber, unit);
    const answer = isNumber
      ? await this.live.request({ command: 'set', target: node, values: { [name]: value } })
      : { done: false, message: 'a number is missing' };
    for (const field of this.fields.values()) {
      const isRefused = field === input && !answer.done;
      field.classList.toggle('refused', isRefused);
      field.setAttribute('aria-invalid', String(isRefused));
    }
    this.state.classList.toggle('bad', !answer.done);
    const shown = isNumber ? `${name} = ${quantityText(inPageUnit(value, unit), unit)}: ` : `${name}: `;
    this.state.textContent = answer.done
      ? `${name} is ${quantityText(inPageUnit(value, unit), unit)} now.`
      : `Refused, and nothing is changed: ${shown}${inPageUnits(withoutNumber(answer.message, name))}`;
    if (!answer.done) input.value = input.dataset.held;
  }
}

/** Return a refusal without its number in SI units, and without what is meant for those who send them. */
function withoutNumber(message, name) {
  const begin = `${name.split('.').pop()} = `;
  const end = ' is refused: ';
  const at = message.indexOf(end);
  const reason = message.startsWith(begin) && at > 0 ? message.slice(at + end.length) : message;
  return reason.replace(/; if [^;]* meant, .*/, '').replace('2 pi rad', '360°');
}
