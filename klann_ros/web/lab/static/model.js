'use strict';
/* The linkage on the page: its numbers, its crank angle, the history of edits, and what follows. */

const MAX_HISTORY = 200;
// Of the crank [rad/s].
const MAX_RATE = 1e6;
// What an edit changes; the crank angle alone is no edit.
const EDITED = ['source', 'read', 'content', 'isKlann', 'linkage', 'name', 'guess', 'rate'];

class Lab {
  constructor(shipped) {
    this.shipped = shipped;
    this.alpha = 0;
    // The crank's rate [rad/s].
    this.rate = 1;
    this.listeners = { pose: [], numbers: [], linkage: [], turn: [], guess: [], history: [] };
    this.refusal = null;
    this.clearHistory();
  }

  /** Have a function called when the crank moves, the numbers change, or the linkage is another. */
  on(event, listener) {
    this.listeners[event].push(listener);
  }

  tell(event) {
    for (const listener of this.listeners[event]) listener();
  }

  choose(name) {
    this.load(this.shipped[name], name);
  }

  /** Take the linkage in a text; a Refusal leaves everything as it is. */
  load(text, source = '') {
    const read = readFile(text, this.shipped.klann);
    const isKlann = isKlannLeg(read.linkage, this.shipped.klann);
    if (isKlann) read.linkage = asTheCourse(read.linkage);
    const arcs = reachableArcs(read.linkage);
    const [start, end] = arcs[0] || [0, 0];
    const alpha = read.start === undefined ? (start + end) / 2 : read.start;
    const pose = poseAt(read.linkage, alpha);
    refuseUnless(
      !pose.error,
      'it does not close where it starts',
      'não fecha na posição em que começa',
    );
    Object.assign(this, { source, read, alpha, isKlann });
    Object.assign(this, { content: read.content, linkage: read.linkage });
    this.name = read.content.name;
    this.isTurned = true;
    this.guess = startGuess(read, pose);
    read.guess = this.guess;
    this.showOther();
  }

  /** Show a linkage with another structure. */
  showOther() {
    this.refusal = null;
    this.isDragged = false;
    this.turn = null;
    this.update();
    this.tell('linkage');
    this.follow(0);
  }

  reset() {
    const { linkage, content } = this.read;
    this.name = content.name;
    this.guess = this.read.guess;
    this.change(linkage);
    this.tell('linkage');
  }

  get numbers() {
    return this.linkage.numbers;
  }

  get shape() {
    return shapeOf(this.linkage);
  }

  /** Turn the crank to an angle of a turn, the shorter way round. */
  turnNear(angle) {
    this.turnTo(this.alpha + wrap(angle - this.alpha));
  }

  turnTo(alpha) {
    this.alpha = alpha;
    this.update();
    this.tell('pose');
  }

  /** Change one number [m, rad]; a Refusal is told, and changes nothing. */
  setNumber(n, value) {
    this.attempt(() => {
      const numbers = [...this.numbers];
      numbers[n] = value;
      this.change(this.linkage.with(numbers, this.linkage.branchAt(this.alpha)));
    });
  }

  /** Take the angles [rad] and lengths [m] that Newton-Raphson starts from. */
  setGuess(guess) {
    this.attempt(() => {
      this.guess = guess;
      this.refusal = null;
      this.tell('guess');
    });
  }

  /** Take a rate of the crank [rad/s]. */
  setRate(rate) {
    this.attempt(() => {
      refuseUnless(Math.abs(rate) <= MAX_RATE, TEXTS.en.tooFast, TEXTS.pt.tooFast);
      this.rate = rate;
      this.refusal = null;
      this.tell('pose');
      if (this.turn) this.tell('turn');
    });
  }

  setName(name) {
    this.attempt(() => {
      this.name = name;
    });
  }

  setSigns(pose) {
    const { structure, numbers, kept, isDyadic } = this.linkage;
    this.attempt(() => {
      const branch = isDyadic ? this.linkage.branchAt(pose.x[0], pose.signs) : { start: pose.x };
      this.change(new Linkage(structure, numbers, { ...kept, ...branch }));
    });
  }

  /** Move a point [m]: a pivot with all lengths as they are, a joint by lengths in such steps [m]. */
  drag(i, target, step) {
    this.attempt(() => {
      const moved = draggedTo(this.linkage, this.pose, this.alpha, i, target, step);
      if (!moved) return;
      this.isTurned ||= this.alpha !== moved.alpha;
      this.alpha = moved.alpha;
      this.change(moved.linkage);
    });
  }

  // Edits.

  /** Make all changes until `commit` one step of the history. */
  begin() {
    if (this.before) return;
    Object.assign(this, { before: this.snapshot(), isTurned: false });
  }

  /** Make an edit in place of what has been changed since `begin`; what makes none takes it back. */
  replace(act) {
    const { linkage, guess, before } = this;
    Object.assign(this, before, { alpha: this.alpha, refusal: null });
    this.attempt(act);
    if (EDITED.some((key) => before[key] !== this[key])) return;
    const { refusal } = this;
    if (linkage !== this.linkage) this.change(this.linkage);
    if (guess !== this.guess) this.tell('guess');
    this.refusal = refusal;
    this.tell('pose');
  }

  commit() {
    // What is shown again loses the focus, which ends the edit of a field.
    if (this.isActing) return;
    const { before } = this;
    this.before = null;
    if (!before || !EDITED.some((key) => before[key] !== this[key])) return;
    this.past.push({ before, after: this.snapshot(), isTurned: this.isTurned });
    if (this.past.length > MAX_HISTORY) this.past.shift();
    this.future = [];
    this.tell('history');
  }

  /** Make an edit, or show in one line why it is refused; a refused one changes nothing. */
  attempt(act) {
    const { isActing } = this;
    const isAlone = !this.before;
    const before = this.snapshot();
    this.begin();
    this.isActing = true;
    try {
      act();
    } catch (error) {
      if (!(error instanceof Refusal)) throw error;
      this.restore(before, before.alpha);
      this.refusal = error;
      this.tell('pose');
    }
    this.isActing = isActing;
    if (isAlone) this.commit();
  }

  undo() {
    this.commit();
    this.stepThrough(this.past, this.future, 'before');
  }

  redo() {
    this.commit();
    this.stepThrough(this.future, this.past, 'after');
  }

  stepThrough(from, to, target) {
    const step = from.pop();
    if (!step) return;
    to.push(step);
    // The crank stays where it was turned to, unless the edit turned it.
    this.restore(step[target], step.isTurned ? step[target].alpha : this.alpha);
    this.tell('history');
  }

  clearHistory() {
    Object.assign(this, { before: null, past: [], future: [] });
  }

  snapshot() {
    return Object.fromEntries([...EDITED, 'alpha'].map((key) => [key, this[key]]));
  }

  restore(state, alpha) {
    this.alpha = alpha;
    if (EDITED.every((key) => state[key] === this[key])) return;
    const isOther = state.read !== this.read;
    Object.assign(this, state, { alpha });
    if (isOther) this.showOther();
    else this.change(state.linkage);
    this.tell('guess');
  }

  change(linkage) {
    if (!linkage.isDyadic) void linkage.branch;
    this.linkage = linkage;
    this.refusal = null;
    this.update();
    this.tell('numbers');
    this.follow(this.isDragged ? 90 : 0);
  }

  update() {
    this.pose = poseAt(this.linkage, this.alpha);
    if (!this.pose.error) this.lastGood = this.pose;
  }

  /** Return a pose for a file's start: this one, or one in the middle of an arc. */
  poseToSave() {
    if (!this.pose.error) return this.pose;
    const arcs = reachableArcs(this.linkage);
    refuseUnless(arcs.length, TEXTS.en.nothingToSave, TEXTS.pt.nothingToSave);
    return poseAt(this.linkage, (arcs[0][0] + arcs[0][1]) / 2);
  }

  /** Work out the whole turn, when there is time for it [ms]. */
  follow(delay) {
    if (this.waiting) return;
    this.waiting = setTimeout(() => {
      this.waiting = null;
      this.arcs = reachableArcs(this.linkage);
      this.turn = turnOf(this.linkage, this.arcs, this.linkage.isDyadic ? 240 : 120);
      this.turn.linkage = this.linkage;
      this.tell('turn');
    }, delay);
  }
}

/** Return the start of a file as Newton-Raphson's guess, or a pose without the crank's angle. */
function startGuess({ linkage, content, start }, pose) {
  const { metre, turn } = unitsOf(content);
  return linkage.structure.bodies
    .map((body, j) =>
      start === undefined ? pose.x[j] : content.start[body.name] * (body.slides ? metre : turn),
    )
    .slice(1);
}

/** Return a Klann leg whose second transmission angle is delta + theta, as the course has it. */
function asTheCourse({ structure, numbers, signs, kept }) {
  return new Linkage(structure, numbers, { ...kept, signs, outside: [2] });
}
