'use strict';
/* The page: what is chosen, opened, turned and saved. */

const lab = new Lab(JSON.parse(byId('data').textContent));
const UNITS = JSON.parse(byId('units').textContent);
const scene = new Scene(byId('scene'), lab);
const statePanel = new StatePanel(lab);
const chart = new TurnChart(byId('chart'), lab);
const curves = new CurvesPanel(byId('curves'), lab);
const values = new ValuesPanel(lab, curves);
const turnTable = new TurnTable(lab);
const assemblies = new AssembliesPanel(byId('assemblies'), lab, scene);
const numbers = new NumbersPanel(byId('numbers'), lab);
const newton = new NewtonPanel(lab, scene);
const pathPanel = new PathPanel(byId('path'), lab);
const crank = { isTurning: false };

// The crank.

/** Return its angle in a turn [deg]; while it turns no more digits than can be read. */
function crankDegrees() {
  const angle = (((lab.alpha % TAU) + TAU) % TAU) * (360 / TAU);
  return crank.isTurning ? rounded(angle, 0.1) : angle;
}

const crankField = new DecimalField(lab, {
  id: 'alpha-number',
  unit: '°',
  value: crankDegrees,
  take: (angle) => {
    crank.isTurning = false;
    lab.turnNear((angle * TAU) / 360);
  },
  revert: () => lab.turnTo(crankField.before),
});
crankField.input.dataset.label = 'crank';
for (const event of ['focus', 'change'])
  crankField.input.addEventListener(event, () => {
    crankField.before = lab.alpha;
  });
byId('alpha-field').append(crankField.input, '°');
byId('alpha-field').parentNode.after(crankField.reason);

function showCrank() {
  const slider = byId('alpha');
  if (document.activeElement !== slider || crank.isTurning) slider.value = crankDegrees();
  crankField.show();
  slider.setAttribute('aria-valuetext', turnText(lab.alpha));
  const { period } = lab.linkage.changes;
  byId('alpha-text').textContent =
    period > 1 ? say('turnOf', turnNumber(lab.alpha, period), period) : '';
  byId('play').textContent = say(crank.isTurning ? 'pause' : 'play');
}

function turnOn(now) {
  if (!crank.isTurning) return;
  const seconds = crank.last === null ? 0 : Math.min((now - crank.last) / 1000, 0.1);
  crank.last = now;
  moveBy(seconds * Number(byId('speed').value) * TAU * crank.direction);
  requestAnimationFrame(turnOn);
}

/** Turn the crank; where its arc ends it turns back. */
function moveBy(step) {
  const next = lab.alpha + step;
  if (poseAt(lab.linkage, next).error && !lab.pose.error) {
    crank.direction = -crank.direction;
    return;
  }
  lab.turnTo(next);
}

function toggle() {
  crank.isTurning = !crank.isTurning;
  if (!crank.isTurning) settle();
  crank.last = null;
  crank.direction = 1;
  // Nobody can listen to each pose of a turn.
  for (const id of ['state', 'verdict'])
    byId(id).setAttribute('aria-live', crank.isTurning ? 'off' : 'polite');
  showCrank();
  if (crank.isTurning) requestAnimationFrame(turnOn);
}

/** Bring a crank that stops to a tenth of a degree, if it closes there. */
function settle() {
  const near = rounded((lab.alpha * 360) / TAU, 0.1) * (TAU / 360);
  if (!poseAt(lab.linkage, near).error) lab.turnTo(near);
}

// History and link.

const link = { first: '', waiting: null };

function showHistory() {
  byId('undo').disabled = !lab.past.length;
  byId('redo').disabled = !lab.future.length;
  if (document.activeElement !== byId('name')) byId('name').value = lab.name;
  showChoice();
}

function step(act) {
  crank.isTurning = false;
  const field = document.activeElement;
  act();
  // What is being typed is no longer the number.
  if (field.matches('.decimal')) field.dispatchEvent(new Event('blur'));
  showCrank();
  showChoice();
}

/** Write the state into the address, when nothing moves. */
function writeLinkSoon() {
  clearTimeout(link.waiting);
  byId('link').hidden = true;
  link.waiting = setTimeout(writeLink, 300);
}

function writeLink() {
  if (isPractising()) return;
  let fragment = '';
  try {
    fragment = linkOf(lab);
  } catch (error) {
    if (!(error instanceof Refusal)) throw error;
  }
  // The lab as it is opened needs no fragment.
  if (fragment !== location.hash && (fragment !== link.first || location.hash))
    history.replaceState(null, '', fragment || location.pathname);
}

async function copyLink() {
  writeLink();
  try {
    linkOf(lab);
  } catch (error) {
    lab.attempt(() => {
      throw error;
    });
    return;
  }
  let text = 'linkCopied';
  try {
    await navigator.clipboard.writeText(location.href);
  } catch {
    // Not allowed, or no secure context.
    text = 'linkInAddress';
  }
  byId('link').textContent = say(text);
  byId('link').hidden = false;
}

/** Open the state of an address's fragment. */
function readLink(fragment) {
  if (fragment.startsWith('#practice')) {
    openPractice(fragment);
    return;
  }
  if (isPractising()) closePractice();
  if (!fragment) return;
  crank.isTurning = false;
  lab.attempt(() => openLink(lab, fragment));
  if (!lab.refusal) scene.fit();
  showChoice();
}

// Files.

/** Load a text, or say in a line why not. */
function loadText(text, source) {
  crank.isTurning = false;
  lab.attempt(() => lab.load(text, source));
  showChoice();
}

function showChoice() {
  document.querySelector('h1').dataset.name =
    (language.now === 'pt' && TITLES[lab.source]) || lab.name;
  byId('linkage').value = Object.hasOwn(lab.shipped, lab.source) ? lab.source : '';
}

async function openFile(file) {
  if (!file) return;
  const refuse = (en, pt) =>
    lab.attempt(() => {
      throw new Refusal(en, pt);
    });
  if (file.size > MAX_FILE_SIZE) {
    refuse(TEXTS.en.tooLong(file.size), TEXTS.pt.tooLong(file.size));
    return;
  }
  let text = null;
  try {
    text = new TextDecoder('utf-8', { fatal: true }).decode(await file.arrayBuffer());
  } catch {
    refuse(TEXTS.en.unreadable, TEXTS.pt.unreadable);
    return;
  }
  loadText(text);
}

function textToSave(asParameters) {
  if (asParameters) return parametersText(lab.linkage);
  const name = lab.name.trim();
  aTitle(name, 'name');
  const text = linkageText(lab.linkage, lab.content, lab.poseToSave().x, name);
  // What it could not read again itself is not saved.
  readFile(text, lab.shipped.klann);
  return text;
}

/** Return the name of the linkage's file, without its ending. */
function fileStem() {
  const stem = byId('name')
    .value.toLowerCase()
    .replace(/[^a-z0-9]+/g, '_')
    .replace(/^_+|_+$/g, '');
  return (stem || 'linkage').slice(0, 60);
}

/** Save a text under a name, or say why there is none. */
function save(textOf, name, ending = 'yaml') {
  lab.attempt(() => {
    const link = made('a');
    link.href = URL.createObjectURL(new Blob([textOf()], { type: `text/${ending}` }));
    link.download = `${name}.${ending}`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
    lab.refusal = null;
    lab.tell('pose');
  });
}

/** Return the requirements for the drawn path: of a shipped linkage as it is, or of the saved file. */
function requirementsText() {
  const isShipped = Object.hasOwn(lab.shipped, lab.source) && lab.linkage === lab.read.linkage;
  return pathPanel.requirements(isShipped ? lab.source : `${fileStem()}.yaml`);
}

function showText() {
  if (document.activeElement === byId('text')) return;
  try {
    byId('text').value = textToSave(false);
  } catch (error) {
    if (!(error instanceof Refusal)) throw error;
    byId('text').value = '';
  }
}

// The language.

function choices() {
  const titles = Object.entries(lab.shipped).map(([name, text]) => [
    name,
    (language.now === 'pt' && TITLES[name]) || readYaml(text).name,
  ]);
  titles.sort((a, b) => a[1].localeCompare(b[1]));
  const select = byId('linkage');
  const { value } = select;
  select.replaceChildren(
    ...titles.map(([name, title]) => new Option(title, name)),
    new Option(say('opened'), ''),
  );
  select.value = value;
}

function nameFoot() {
  byId('drawing-hint').textContent = say('drawingHint', ofFoot(lab));
  byId('path-title').textContent = say('path', ofFoot(lab));
}

function speak(now) {
  language.now = now;
  translate();
  for (const button of document.querySelectorAll('[data-language]'))
    button.setAttribute('aria-pressed', String(button.dataset.language === now));
  nameFoot();
  choices();
  showChoice();
  statePanel.show();
  statePanel.showTurn();
  numbers.build();
  newton.build();
  values.build();
  curves.offer();
  curves.draw();
  if (lab.turn) turnTable.show();
  chart.draw();
  assemblies.soon();
  scene.nameGrips();
  pathPanel.write();
  showCrank();
  if (isPractising()) lab.practice.build();
}

function listen() {
  const on = (id, event, act) => byId(id).addEventListener(event, act);
  on('play', 'click', toggle);
  on('alpha', 'input', () => lab.turnNear((Number(byId('alpha').value) * TAU) / 360));
  on('linkage', 'change', () => {
    if (byId('linkage').value) loadText(lab.shipped[byId('linkage').value], byId('linkage').value);
  });
  on('open', 'click', () => byId('file').click());
  on('file', 'change', () => {
    openFile(byId('file').files[0]);
    byId('file').value = '';
  });
  on('reset', 'click', () => lab.attempt(() => lab.reset()));
  on('undo', 'click', () => step(() => lab.undo()));
  on('redo', 'click', () => step(() => lab.redo()));
  on('copy-link', 'click', copyLink);
  on('practise', 'click', () => openPractice('#practice='));
  // Not location.hash: the state before may have been written into it meanwhile.
  window.addEventListener('hashchange', (event) => readLink(new URL(event.newURL).hash));
  on('fit', 'click', () => scene.fit());
  on('others', 'change', () => {
    scene.hasOthers = byId('others').checked;
    scene.showOthers([]);
    assemblies.show();
  });
  on('print', 'click', () => window.print());
  on('skip', 'click', (event) => {
    // The address holds the state.
    event.preventDefault();
    byId('values-title').focus();
  });
  on('table-save', 'click', () => save(() => turnTable.text(), `${fileStem()}_turn`, 'csv'));
  on('save-linkage', 'click', () => save(() => textToSave(false), fileStem()));
  on('save-parameters', 'click', () => save(() => textToSave(true), `${fileStem()}_parameters`));
  on('save-requirements', 'click', () => save(requirementsText, 'requirements'));
  on('load-text', 'click', () => loadText(byId('text').value, ''));
  on('name', 'input', () => {
    lab.begin();
    lab.setName(byId('name').value);
    showText();
  });
  on('name', 'change', () => lab.commit());
  for (const button of document.querySelectorAll('[data-language]'))
    button.addEventListener('click', () => speak(button.dataset.language));
  document.addEventListener('keydown', (event) => {
    // Where the space bar writes, presses or opens something it does.
    const isTaken = event.target.closest(
      'input:not([type=range]), select, textarea, button, summary',
    );
    const isAlone = !(event.ctrlKey || event.altKey || event.metaKey || event.shiftKey);
    if (isPractising() || event.key !== ' ' || isTaken || !isAlone) return;
    event.preventDefault();
    toggle();
  });
  document.addEventListener('keydown', (event) => {
    const key = event.key.toLowerCase();
    if (!(event.ctrlKey || event.metaKey) || event.altKey || !'zy'.includes(key)) return;
    // Where text is written, the browser has a history of its own.
    if (isPractising() || event.target.closest('#name, #text')) return;
    event.preventDefault();
    step(() => (key === 'y' || event.shiftKey ? lab.redo() : lab.undo()));
  });
  document.addEventListener('dragover', (event) => event.preventDefault());
  document.addEventListener('drop', (event) => {
    event.preventDefault();
    openFile(event.dataTransfer.files[0]);
  });
}

lab.on('linkage', () => {
  nameFoot();
  showChoice();
  showHistory();
  byId('save-parameters').hidden = !lab.isKlann;
});
lab.on('history', showHistory);
for (const event of ['linkage', 'pose', 'numbers']) lab.on(event, showCrank);
for (const event of ['linkage', 'pose', 'numbers', 'guess', 'history'])
  lab.on(event, writeLinkSoon);
lab.on('turn', showText);
listen();
choices();
lab.choose('klann');
link.first = linkOf(lab);
speak(language.now);
readLink(location.hash);
lab.clearHistory();
showHistory();
