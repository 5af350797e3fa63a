'use strict';
/*
 * The walker of the selected leg in three dimensions, or its views from the side and from above: as
 * chosen, and where the browser has no WebGL. three.js is loaded for the first walker.
 */

const THREE_FILE = '/static/three.min.js';
const NO_WEBGL =
  'This browser draws nothing in space, as it has no WebGL: the views from the side and above show the same.';
const NOT_LOADED =
  'The drawing in space was not loaded: the views from the side and above show the same.';
const LOST =
  'The graphics of this browser were lost: the views from the side and above show the same.';
// Lost graphics come back within this time, if they do [ms].
const RESTORE_TIME = 3000;
const SPACE_TEXT = 'Drag to turn, or press the arrow keys, + and −; double-click or Home: back.';
const FLAT_TEXT = 'From the right, and from above; forward is to the right.';

let threeScript = null;

function loadThree() {
  threeScript ??= new Promise((resolve, reject) => {
    const script = document.createElement('script');
    script.src = THREE_FILE;
    script.addEventListener('load', resolve);
    script.addEventListener('error', reject);
    document.head.append(script);
  });
  return threeScript;
}

class Stage {
  constructor(live) {
    this.live = live;
    this.card = byId('space').parentElement;
    this.canvas = byId('space');
    this.note = byId('space-note');
    this.buttons = { space: byId('view-space'), flat: byId('view-flat') };
    this.isChosen = true;
    this.scene = null;
    this.failure = '';
    this.legs = [];
    this.node = '';
    this.text = '';
    for (const [name, button] of Object.entries(this.buttons)) {
      button.addEventListener('click', () => this.choose(name === 'space'));
    }
    this.canvas.addEventListener('webglcontextlost', () => this.lose());
    this.canvas.addEventListener('webglcontextrestored', () => this.restore());
    onThemeChange(() => this.rebuild());
    this.choose(true);
  }

  get isInSpace() {
    return this.isChosen && !this.failure;
  }

  choose(isChosen) {
    this.isChosen = isChosen;
    this.arrange();
  }

  /** Show the walker that the selected leg belongs to; the first one without such a leg. */
  arrange() {
    const { isInSpace, live } = this;
    const mounted = live.legs.filter((leg) => leg.shape && leg.mount);
    const solvers = mounted.map((leg) => leg.solver);
    const isWalker = (solver) => solvers.filter((other) => other === solver).length > 1;
    const ofLeg = live.leg && live.leg.mount && isWalker(live.leg.solver) ? live.leg.solver : null;
    const solver = ofLeg || solvers.find(isWalker);
    this.legs = mounted.filter((leg) => leg.solver === solver);
    if (solver && solver.node !== this.node) {
      // The path walked is another walker's.
      this.node = solver.node;
      for (const ground of [live.ground, live.truth]) ground.forget();
    }
    this.buttons.space.disabled = Boolean(this.failure);
    this.buttons.space.setAttribute('aria-pressed', String(isInSpace));
    this.buttons.flat.setAttribute('aria-pressed', String(!isInSpace));
    this.card.classList.toggle('in-space', isInSpace);
    this.note.hidden = !this.failure;
    this.note.textContent = this.failure;
    byId('view-text').textContent = isInSpace ? SPACE_TEXT : FLAT_TEXT;
    if (isInSpace && this.legs.length)
      loadThree().then(
        () => this.build(),
        () => this.fail(NOT_LOADED),
      );
    this.showGrid();
    this.show();
  }

  /** Build the scene again, if the robot is another or looks otherwise. */
  build() {
    if (!this.isInSpace || !this.legs.length) return;
    const { solver } = this.legs[0];
    const { body, parts } = solver;
    const text = JSON.stringify([solver.node, body, this.legs.map((leg) => leg.text), parts]);
    if (text === this.text) return;
    const legs = this.legs.map(({ name, shape, mount }) => ({ name, shape, mount }));
    try {
      this.scene ??= new RobotScene(this.canvas, { isFree: () => !this.live.walk.isMine });
      this.scene.build({ legs: withModels(legs, parts), body });
      this.text = text;
    } catch (error) {
      this.fail(NO_WEBGL);
      return;
    }
    this.showGrid();
    this.show();
  }

  rebuild() {
    this.text = '';
    if (this.scene) this.build();
  }

  showGrid() {
    const shown = this.isInSpace ? this.scene : this.live.views[0];
    if (shown)
      byId('grid').textContent = String(
        Number((1000 * (shown.cell || shown.grid)).toPrecision(1)),
      );
  }

  /** Show the newest poses, on the true ground of a simulation or on that of the odometry. */
  show() {
    if (!this.isInSpace) {
      for (const picture of this.live.views) picture.show((leg) => this.live.trackOf(leg));
      return;
    }
    if (!this.scene || !this.text) return;
    const tracks = this.legs.map((leg) => this.live.trackOf(leg));
    this.canvas.classList.toggle(
      'old',
      tracks.every((track) => track.age > OLD),
    );
    const { truth, ground } = this.live;
    const { slope } = this.legs[0].solver;
    const place = truth.place ? { ...truth.pose, slope } : ground.pose;
    this.scene.show(
      tracks.map((track) => track.points),
      place,
    );
  }

  /** Show the flat views, for a reason. */
  fail(reason) {
    this.failure = reason;
    this.arrange();
  }

  lose() {
    this.lost = setTimeout(() => this.fail(LOST), RESTORE_TIME);
  }

  restore() {
    clearTimeout(this.lost);
    this.failure = '';
    this.arrange();
    this.show();
  }
}
