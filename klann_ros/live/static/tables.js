'use strict';
/* Lists and tables: every text of others is text, whatever is in it. */

const LEVEL_CLASS = { fine: 'good', look: 'warning', fault: 'error', silent: 'note' };
const LEVEL_MARK = { fine: '✓', look: '!', fault: '×', silent: '…' };
const SERVICE_WORDS = {
  pause: 'Pause', resume: 'Resume', split: 'New file', step: 'One message on', trigger: 'Keep this moment',
};

/** Make an element with texts or elements in it. */
function make(name, className, ...content) {
  const node = document.createElement(name);
  if (className) node.className = className;
  node.append(...content);
  return node;
}

/** Show what nodes say of themselves; what several say alike is said once. */
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
  const own = status.meaning && status.level !== 'fine' ? make('em', '', status.text) : '';
  const figures = Object.entries(status.figures).map(([key, value]) => `${key} ${value}`);
  const words = make(
    'div',
    '',
    make('b', '', whose(group)),
    ` ${status.meaning || status.text}`,
    own,
    group.length === 1 ? make('em', 'figures', figures.join(' · ')) : '',
  );
  return make('li', LEVEL_CLASS[status.level], mark, words);
}

/** Return the names of a group, what they have in common once. */
function whose(group) {
  const [first, ...others] = group.map((status) => status.who);
  const [node, leg] = first.split(': ');
  if (!leg || others.some((who) => !who.startsWith(`${node}: `))) return [first, ...others].join(', ');
  return `${node}: ${[leg, ...others.map((who) => who.slice(node.length + 2))].join(', ')}`;
}

function showTopics(body, topics) {
  const rows = topics.map((topic) => {
    const head = make('th', '', topic.name);
    head.scope = 'row';
    const rate = topic.silence === null ? topic.rate.toFixed(1) : `silent for ${topic.silence} s`;
    const lost = topic.lost === null ? 'cannot be told' : String(topic.lost);
    const cells = [rate, lost, String(topic.publishers), topic.type];
    return make('tr', '', head, ...cells.map((text) => make('td', '', text)));
  });
  body.replaceChildren(...rows);
}

/** A recorder or a player: what it says, and its buttons. */
class MachineCard {
  constructor(live, machine) {
    this.live = live;
    this.node = machine.node;
    const title = machine.kind === 'recorder' ? 'Recorder' : 'Player';
    this.text = make('p', '');
    this.said = make('p', 'quiet');
    this.said.setAttribute('role', 'status');
    const buttons = machine.services.map((name) => {
      const button = make('button', '', SERVICE_WORDS[name] || name);
      button.type = 'button';
      button.disabled = !live.may;
      button.addEventListener('click', () => this.want({ do: 'call', name }));
      return button;
    });
    this.card = make(
      'div',
      'card',
      make('h3', '', `${title} ${machine.node}`),
      this.text,
      make('div', 'buttons', ...buttons),
      this.said,
    );
    if (machine.kind === 'player') this.card.insertBefore(this.seek(machine), this.said);
  }

  seek(machine) {
    const input = make('input', '');
    Object.assign(input, { type: 'range', min: 0, max: machine.length || 1, step: 'any' });
    input.value = machine.position || 0;
    input.disabled = !this.live.may;
    const output = make('output', '');
    const say = () => (output.textContent = `${Number(input.value).toFixed(2)} s`);
    say();
    input.addEventListener('input', say);
    input.addEventListener('change', () => this.want({ do: 'seek', value: Number(input.value) }));
    this.slider = input;
    this.say = say;
    return make('label', 'slider', 'Go to ', output, input);
  }

  tell(machine) {
    if (machine.kind === 'recorder') {
      const counts = 'written' in machine
        ? `${machine.written.toLocaleString('en')} messages written, ${machine.lost.toLocaleString('en')} lost`
        : 'no figures yet';
      this.text.textContent = `${machine.paused ? 'Paused' : 'Recording'}: ${counts}.`;
    } else {
      const known = (value, unit) => (value === undefined ? '–' : `${value.toFixed(2)} ${unit}`);
      this.text.textContent = `${known(machine.length, 's')} long, at ${known(machine.rate, '×')}; last told to be at ${known(machine.position, 's')}.`;
      if (this.slider !== document.activeElement) {
        this.slider.max = machine.length || 1;
        this.slider.value = machine.position || 0;
        this.say();
      }
    }
  }

  async want(wish) {
    const answer = await this.live.want({ what: this.node, ...wish });
    this.said.textContent = answer.done ? answer.said || 'Done.' : `Refused: ${answer.said}`;
  }
}

/** The lengths of a leg, each a field; what a solver refuses goes back to what it was. */
class LengthFields {
  constructor(live, holder, state) {
    this.live = live;
    this.holder = holder;
    this.state = state;
    this.key = '';
    this.fields = new Map();
  }

  tell(solver, leg) {
    const lengths = solver ? solver.lengths.filter((one) => one.leg === leg.name && one.unit) : [];
    byId('lengths-section').hidden = !lengths.length;
    const key = JSON.stringify([solver && solver.node, this.live.may, lengths.map((one) => one.name)]);
    if (key !== this.key) {
      this.key = key;
      this.fields.clear();
      this.holder.replaceChildren(...lengths.map((one) => this.field(solver.node, one)));
      this.state.textContent = this.live.may
        ? 'A new number is the solver’s at once; it says so if it cannot be.'
        : 'This page may only view.';
    }
    for (const one of lengths) {
      const input = this.fields.get(one.name);
      input.dataset.held = shortened(one.value);
      if (input !== document.activeElement) input.value = shortened(one.value);
    }
  }

  field(node, one) {
    const input = make('input', '');
    Object.assign(input, { type: 'number', step: one.unit === 'm' ? 0.001 : 0.01 });
    input.value = shortened(one.value);
    input.disabled = !this.live.may;
    input.addEventListener('change', () => this.set(node, one.name, input));
    this.fields.set(one.name, input);
    return make('label', '', `${one.name.split('.').pop()} [${one.unit}]`, input);
  }

  async set(node, name, input) {
    const value = Number(input.value);
    const answer = await this.live.want({ do: 'set', what: node, values: { [name]: value } });
    input.classList.toggle('refused', !answer.done);
    input.setAttribute('aria-invalid', String(!answer.done));
    this.state.classList.toggle('bad', !answer.done);
    this.state.textContent = answer.done
      ? `${name} is ${value} now.`
      : `Refused, and nothing is changed: ${answer.said}`;
    if (!answer.done) input.value = input.dataset.held;
  }
}

/** Return a number with the digits that one can read. */
function shortened(value) {
  return Number(value.toPrecision(7));
}
