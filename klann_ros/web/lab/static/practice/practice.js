'use strict';
/* The practice mode: the exercise of a student number, its fields, their marks and the solution. */

const STUDENT = /^(\d{1,64}|[A-Za-z][A-Za-z0-9._-]{0,63})$/;
const MAX_RANDOM = 1e6;

class Practice {
  constructor(section, data) {
    Object.assign(this, { section, data, rows: [], isSolved: false });
  }

  say(key, ...values) {
    let text = this.data.texts.practice[key][language.now];
    for (const value of values) text = text.replace('{}', value);
    return text;
  }

  /** Show the exercise of a link's parts; a Refusal says what of them is wrong. */
  open({ practice: name, seed = String(Math.floor(Math.random() * MAX_RANDOM)) }) {
    const refuse = (isGood, key, value) => {
      const texts = this.data.texts.practice[key];
      const inText = (text) => text.replace('{}', printable(value, 40));
      refuseUnless(isGood, inText(texts.en), inText(texts.pt));
    };
    refuse(!name || Object.hasOwn(this.data.kinds, name), 'unknown', name);
    refuse(STUDENT.test(seed), 'refused', seed);
    this.exercise = new Exercise(this.data, name || 'four-bar-position', seed);
    this.isSolved = false;
    this.build();
  }

  get fragment() {
    const { kind, student } = this.exercise;
    return `#practice=${kind.name}&seed=${student}&lang=${language.now}`;
  }

  /** Build the page of the exercise, in the page's language. */
  build() {
    const { kind } = this.exercise;
    const texts = this.data.texts;
    const { title, task } = texts.kinds[kind.name][language.now];
    const answers = this.answers();
    this.svg = document.createElementNS(SVG, 'svg');
    this.svg.setAttribute('role', 'img');
    this.title = made('h2', '', title);
    this.title.tabIndex = -1;
    const figure = made('div', 'practice-figure');
    figure.append(this.svg);
    const given = made('div', 'practice-given');
    given.append(made('h3', '', texts.sheet.given[language.now]), this.givens());
    const text = made('p');
    const lines = [task, texts.notes[kind.own.note]?.[language.now] ?? ''].join('\n');
    for (const line of lines.split('\n')) text.append(...rich(line), made('br'));
    const note = made('p', 'quiet', texts.sheet.degrees[language.now]);
    this.solution = made('div', 'practice-steps');
    const grid = made('div', 'practice-grid');
    const work = made('div');
    work.append(given, this.form(), this.solution);
    grid.append(figure, work);
    const local = made('p', 'quiet', this.say('local'));
    this.section.replaceChildren(this.bar(), this.title, text, note, grid, local);
    for (const { question, input } of this.rows) input.value = answers[question.name] ?? '';
    this.draw();
    if (this.isSolved) this.solve();
  }

  bar() {
    const bar = made('div', 'bar');
    const { kind, student } = this.exercise;
    const titles = this.data.texts.kinds;
    const select = made('select');
    const names = Object.keys(this.data.kinds);
    select.append(...names.map((name) => new Option(titles[name][language.now].title, name)));
    select.value = kind.name;
    select.addEventListener('change', () => this.go(select.value, student));
    const seed = Object.assign(made('input'), { type: 'text', value: student, maxLength: 64 });
    seed.autocomplete = 'off';
    seed.addEventListener('change', () => this.go(kind.name, seed.value.trim()));
    bar.append(labelled(this.say('kind'), select), labelled(this.say('seed'), seed));
    bar.append(
      button(this.say('next'), () => this.go(kind.name)),
      button(this.say('copy'), copyLink),
      button(this.say('back'), closePractice),
    );
    return bar;
  }

  /** Show another exercise; a number that is refused changes nothing. */
  go(name, seed) {
    const had = document.activeElement.tagName;
    lab.attempt(() => {
      this.open({ practice: name, seed });
      lab.refusal = null;
      lab.tell('pose');
      history.replaceState(null, '', this.fragment);
    });
    this.section.querySelector(had === 'BUTTON' ? '.bar button' : had.toLowerCase())?.focus();
  }

  givens() {
    const table = made('table');
    const { units } = this.data;
    for (const [name, value] of Object.entries(this.exercise.givens)) {
      const unit = Object.keys(units).find((each) => units[each].split(/\s+/).includes(name));
      const row = table.insertRow();
      const head = made('th');
      head.append(...symbolOf(this.data.notation, name));
      row.append(head, made('td', '', withUnit(this.data.notation, value, unit ?? 'mm')));
      row.addEventListener('pointerenter', () => this.figure.show(name));
    }
    return table;
  }

  form() {
    const form = made('form', 'practice-form');
    form.noValidate = true;
    form.append(made('h3', '', this.data.texts.sheet.asked[language.now]));
    this.rows = this.exercise.kind.questions.map((question) => this.row(question));
    form.append(...this.rows.map(({ node }) => node));
    const submit = button(this.say('mark'), () => {});
    submit.type = 'submit';
    submit.className = 'primary';
    const buttons = made('div', 'bar');
    buttons.append(submit, button(this.say('solve'), () => this.solve()));
    this.points = made('p', 'practice-points');
    this.points.setAttribute('role', 'status');
    form.append(buttons, this.points);
    form.addEventListener('submit', (event) => {
      event.preventDefault();
      this.mark();
    });
    return form;
  }

  row(question) {
    const { notation, texts } = this.data;
    const node = made('div', 'practice-row');
    const name = made('label');
    const words = rich(texts.questions[question.name]?.[language.now] ?? '');
    const isWord = notation.words.split(' ').includes(question.name);
    name.append(...(isWord ? words : symbolOf(notation, question.name)));
    if (!isWord && words[0]) name.append(', ', ...words);
    const input = this.field(question);
    input.id = `practice-${question.name}`;
    name.htmlFor = input.id;
    const unit = made('span', '', notation.units[question.unit] ?? question.unit);
    const mark = made('p', 'practice-mark');
    mark.id = `${input.id}-mark`;
    input.setAttribute('aria-describedby', mark.id);
    input.addEventListener('focus', () => this.figure.show(question.name));
    input.addEventListener('input', () => this.unmark({ node, input, mark }));
    node.append(name, input, unit, mark);
    mark.textContent = this.asked(question);
    return { question, node, input, mark };
  }

  field(question) {
    if (question.choices.length) {
      const select = made('select');
      const words = question.choices.map((each) => new Option(wordOf(this.data, each), each));
      select.append(new Option(this.say('choose'), ''), ...words);
      return select;
    }
    // The number pad of some telephones has no minus.
    return Object.assign(made('input'), { type: 'text', inputMode: 'text', autocomplete: 'off', maxLength: 64 });
  }

  asked(question) {
    const { sheet } = this.data.texts;
    if (question.choices.length) return '';
    if (question.unit === 'count') return sheet.whole[language.now];
    return sheet.digits[language.now].replace('{}', this.exercise.kind.digits);
  }

  unmark({ node, input, mark }) {
    node.classList.remove('good', 'bad');
    input.removeAttribute('aria-invalid');
    mark.textContent = '';
    this.points.textContent = '';
  }

  answers() {
    return Object.fromEntries(this.rows.map(({ question, input }) => [question.name, input.value]));
  }

  /** Mark all fields, each with its reason. */
  mark() {
    const { marks: words, slips } = this.data.texts;
    const marks = markAnswers(this.exercise, this.answers());
    marks.forEach(({ points, slip, isCarried }, n) => {
      const row = this.rows[n];
      this.unmark(row);
      const carried = isCarried ? `; ${words.carried[language.now]}` : '';
      const plain = `${(words[slip] ?? slips[slip])[language.now]}${carried}`;
      const isDoubtful = !points && slip in slips;
      const reason = isDoubtful ? words.perhaps[language.now].replace('{}', plain) : plain;
      const part = points > 0 && points < 1 ? ` (${localised(String(points))})` : '';
      row.mark.textContent = `${points === 1 ? '✓' : '✗'} ${reason}${part}`;
      row.node.classList.add(points === 1 ? 'good' : 'bad');
      row.input.setAttribute('aria-invalid', String(points < 1));
    });
    const sum = marks.reduce((total, { points }) => total + points, 0);
    const shown = localised(String(Number(sum.toFixed(2))));
    this.points.textContent = this.say('points', shown, marks.length);
    this.rows.find((_, n) => marks[n].points < 1)?.input.focus();
  }

  /** Show the key and every step; a step with the focus is shown in the drawing. */
  solve() {
    this.isSolved = true;
    this.draw();
    const { notation, texts } = this.data;
    const items = this.exercise.worked.steps.map(({ symbol, value, unit, formula }) => {
      const step = button('', () => this.figure.show(symbol));
      const result = made('b');
      result.append(...symbolOf(notation, symbol), ` = ${withUnit(notation, value, unit)}`);
      step.append(...rich(inLanguage(formula)), made('br'), result);
      for (const event of ['focus', 'pointerenter'])
        step.addEventListener(event, () => this.figure.show(symbol));
      const item = made('li');
      item.append(step);
      return item;
    });
    const list = made('ol');
    list.append(...items);
    this.solution.replaceChildren(made('h3', '', texts.sheet.solution[language.now]), list);
    for (const { question, mark, node } of this.rows) {
      const answer = answerText(this.exercise, question, this.exercise.answers[question.name]);
      node.querySelector('.practice-key')?.remove();
      mark.before(made('output', 'practice-key', `${texts.sheet.key[language.now]}: ${answer}`));
    }
  }

  draw() {
    this.figure = new Figure(this.svg, this.exercise, this.isSolved);
    const text = this.say(this.figure.names.length ? 'drawing' : 'undrawn');
    this.svg.setAttribute('aria-label', text);
    this.svg.parentNode.querySelector('p')?.remove();
    this.svg.after(made('p', 'quiet hint', text));
  }
}

function labelled(text, field) {
  const label = made('label', '', `${text} `);
  label.append(field);
  return label;
}

function button(text, act) {
  const node = made('button', '', text);
  node.type = 'button';
  node.addEventListener('click', act);
  return node;
}

globalThis.Practice = Practice;
