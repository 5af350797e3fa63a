'use strict';
/* The linkage that is on the table: what it is, where its crank is, and what follows. */

class Lab {
  constructor(shipped) {
    this.shipped = shipped;
    this.alpha = 0;
    this.listeners = { pose: [], numbers: [], linkage: [], turn: [] };
    this.refusal = null;
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
    this.change(linkage);
    this.tell('linkage');
  }

  get numbers() {
    return this.linkage.numbers;
  }

  get shape() {
    return shapeOf(this.linkage);
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
      this.change(this.linkage.with(numbers));
    });
  }

  setSigns(pose) {
    const { structure, numbers, kept, isDyadic } = this.linkage;
    this.attempt(() => {
      const branch = isDyadic ? { signs: pose.signs } : { start: pose.x };
      this.change(new Linkage(structure, numbers, { ...kept, ...branch }));
    });
  }

  /** Move a point [m]: a pivot with all lengths as they are, a joint by new lengths. */
  drag(i, target) {
    this.attempt(() => {
      const moved = draggedTo(this.linkage, this.pose, this.alpha, i, target);
      if (!moved) return;
      this.alpha = moved.alpha;
      this.change(moved.linkage);
    });
  }

  attempt(act) {
    try {
      act();
    } catch (error) {
      if (!(error instanceof Refusal)) throw error;
      this.refusal = error;
      this.tell('pose');
    }
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

  /** Work out the whole turn, when there is time for it [ms]. */
  follow(delay) {
    if (this.waiting) return;
    this.waiting = setTimeout(() => {
      this.waiting = null;
      this.arcs = reachableArcs(this.linkage);
      this.turn = turnOf(this.linkage, this.arcs, this.linkage.isDyadic ? 240 : 120);
      this.tell('turn');
    }, delay);
  }
}

/** Return a Klann leg whose second transmission angle is delta + theta, as the course has it. */
function asTheCourse({ structure, numbers, signs, name }) {
  return new Linkage(structure, numbers, { signs, name, outside: [2] });
}
