'use strict';
/* The walker of a leg in three dimensions, on demand: it walks by the crank of the other legs. */

const NO_WEBGL = 'This browser draws nothing in space, as it has no WebGL.';
const LEVEL = [0, 0, 0, 1];

class WalkerView {
  constructor(place, leg) {
    this.leg = leg;
    this.turns = 0;
    this.part = 0;
    this.scene = null;
    this.canvas = make('canvas');
    Object.assign(this.canvas, { tabIndex: 0, hidden: true });
    this.canvas.setAttribute('role', 'img');
    const keys = 'Drag to turn, or press the arrow keys, + and −; Home: back.';
    this.canvas.setAttribute('aria-label', `The walker of ${leg.name}. ${keys}`);
    this.note = make('p', '', 'quiet');
    const button = make('button', 'Walker in three dimensions');
    button.type = 'button';
    button.setAttribute('aria-pressed', 'false');
    button.addEventListener('click', () => {
      const isShown = !this.scene;
      if (isShown) this.open();
      else this.dispose();
      this.canvas.hidden = !this.scene;
      this.note.textContent = this.scene ? keys : isShown ? NO_WEBGL : '';
      button.setAttribute('aria-pressed', String(Boolean(this.scene)));
    });
    place.append(button, this.canvas, this.note);
    onThemeChange(() => this.scene && this.build());
  }

  open() {
    try {
      this.canvas.hidden = false;
      this.scene = new RobotScene(this.canvas);
      this.build();
    } catch {
      this.scene = null;
    }
  }

  build() {
    const { walker } = this.leg;
    const { x, y } = boxOf(this.leg);
    const corner = (side) => [x.middle + side * x.size, y.middle + side * y.size];
    const shape = { ...this.leg.shape, box: [...corner(-0.5), ...corner(0.5)] };
    const legs = walker.legs.map((name) => {
      const { mount_xyz: xyz, mount_rpy: rpy } = walker[name];
      return { name, shape, mount: { xyz, rpy } };
    });
    const body = { size: walker.body_size, centre: walker.body_centre };
    this.scene.build({ legs: withModels(legs, walker.parts), body });
    this.go(this.part);
  }

  /** Show the walker after a part of a turn of its cranks. */
  go(part) {
    if (part < this.part) this.turns += 1;
    this.part = part;
    if (!this.scene) return;
    const { points, walker, figures } = this.leg;
    const poses = walker.legs.map((name) => {
      const { phase, direction } = walker[name];
      const turn = phase / (2 * Math.PI) + direction * part;
      return points[Math.round((turn - Math.floor(turn)) * points.length) % points.length];
    });
    const x = ((2 * Math.PI * figures.speed) / data.speed) * (this.turns + part);
    this.scene.show(poses, { at: [x, 0, null], turn: LEVEL, path: [] });
  }

  dispose() {
    this.scene?.dispose();
    this.scene = null;
  }
}
