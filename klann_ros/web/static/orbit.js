'use strict';
/* The camera around a robot: by mouse, touch and keys. One finger up or down scrolls the page. */

const ORBIT_KEYS = {
  ArrowLeft: [0.1, 0, 1],
  ArrowRight: [-0.1, 0, 1],
  ArrowUp: [0, 0.1, 1],
  ArrowDown: [0, -0.1, 1],
  '+': [0, 0, 0.9],
  '=': [0, 0, 0.9],
  '-': [0, 0, 1 / 0.9],
};
// [rad]; from below the ground nothing is seen.
const ELEVATION = { min: 0.02, max: 1.55 };
// In sizes of the robot.
const ZOOM = { min: 0.4, max: 8 };
const FIRST_VIEW = { azimuth: -1.1, elevation: 0.35, zoom: 1.1 };

class Orbit {
  /** `changed` is called after each change; `isFree` returns whether arrow keys are the camera's. */
  constructor(canvas, changed, isFree = () => true) {
    this.canvas = canvas;
    this.changed = changed;
    this.isFree = isFree;
    this.pointers = new Map();
    this.reset();
    canvas.addEventListener('pointerdown', (event) => this.grab(event));
    canvas.addEventListener('pointermove', (event) => this.pull(event));
    for (const name of ['pointerup', 'pointercancel', 'lostpointercapture']) {
      canvas.addEventListener(name, (event) => this.pointers.delete(event.pointerId));
    }
    canvas.addEventListener('pointercancel', () => this.turnBack());
    canvas.addEventListener('keydown', (event) => this.key(event));
    canvas.addEventListener('wheel', (event) => this.roll(event), { passive: false });
    canvas.addEventListener('dblclick', () => this.reset());
  }

  reset() {
    Object.assign(this, FIRST_VIEW);
    this.changed();
  }

  turn(azimuth, elevation, zoom) {
    this.azimuth += azimuth;
    this.elevation = Math.min(ELEVATION.max, Math.max(ELEVATION.min, this.elevation + elevation));
    this.zoom = Math.min(ZOOM.max, Math.max(ZOOM.min, this.zoom * zoom));
    this.changed();
  }

  /** Return the direction from the robot to the camera. */
  get direction() {
    const { azimuth, elevation } = this;
    const flat = Math.cos(elevation);
    return [flat * Math.cos(azimuth), flat * Math.sin(azimuth), Math.sin(elevation)];
  }

  /** Undo what a finger has turned that scrolls the page. */
  turnBack() {
    Object.assign(this, this.viewBefore);
    this.changed();
  }

  grab(event) {
    const { azimuth, elevation, zoom } = this;
    this.viewBefore = { azimuth, elevation, zoom };
    this.canvas.setPointerCapture(event.pointerId);
    this.pointers.set(event.pointerId, [event.clientX, event.clientY]);
  }

  pull(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    const at = [event.clientX, event.clientY];
    const partner = [...this.pointers].find(([id]) => id !== event.pointerId);
    this.pointers.set(event.pointerId, at);
    const distance = ([x, y]) => Math.hypot(x - partner[1][0], y - partner[1][1]) || 1;
    const zoom = partner ? distance(before) / distance(at) : 1;
    const scale = (partner ? 2 : 4) / this.canvas.clientHeight;
    this.turn(scale * (before[0] - at[0]), scale * (at[1] - before[1]), zoom);
  }

  key(event) {
    if (event.altKey || event.ctrlKey || event.metaKey) return;
    if (event.key === 'Home') this.reset();
    else if (ORBIT_KEYS[event.key] && (!event.key.startsWith('Arrow') || this.isFree())) {
      this.turn(...ORBIT_KEYS[event.key]);
    } else return;
    event.preventDefault();
  }

  /** Zoom by the wheel where the robot was clicked: before, the wheel scrolls the page. */
  roll(event) {
    if (document.activeElement !== this.canvas) return;
    event.preventDefault();
    this.turn(0, 0, Math.exp(0.001 * event.deltaY));
  }
}
