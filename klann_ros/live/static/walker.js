'use strict';
/* All legs of a walker in base_link, from the side and from above, on ground that moves by odom. */

// Distance between points of the path walked [m].
const PATH_STEP = 0.01;
const PATH_POINTS = 2000;
// A larger step of the odometry is a reset [m].
const JUMP = 0.5;

/** The ground under a walker, by its odometry, or the true one of a simulation. */
class Ground {
  constructor({ hasHeight = false } = {}) {
    this.hasHeight = hasHeight;
    this.forget();
  }

  forget() {
    this.place = null;
    this.height = null;
    this.attitude = [0, 0, 0, 1];
    this.travel = 0;
    this.path = [];
  }

  /** Take x, y [m], heading [rad], z and attitude of the walker; undefined without odometry. */
  move(odom) {
    if (!odom) {
      if (this.hasHeight) this.forget();
      return;
    }
    const [x, y, yaw] = odom;
    if (this.hasHeight) this.height = odom[5];
    this.attitude = odom.slice(6);
    const [u, v] = this.place ? [x - this.place[0], y - this.place[1]] : [0, 0];
    if (Math.hypot(u, v) > JUMP) this.path = [];
    else this.travel += u * Math.cos(yaw) + v * Math.sin(yaw);
    this.place = [x, y, yaw];
    const last = this.path[this.path.length - 1];
    if (!last || Math.hypot(x - last[0], y - last[1]) > PATH_STEP) this.path.push([x, y, this.height]);
    if (this.path.length > PATH_POINTS) this.path.splice(0, PATH_POINTS / 10);
  }

  /** Return a point of the ground in base_link, from above. */
  toBase([x, y]) {
    const [left, bottom, yaw] = this.place;
    const [u, v] = [x - left, y - bottom];
    const [c, s] = [Math.cos(yaw), Math.sin(yaw)];
    return [c * u + s * v, c * v - s * u];
  }

  /** The place of base_link for RobotScene. */
  get pose() {
    const [x, y] = this.place || [0, 0];
    return { at: [x, y, this.height], turn: this.attitude, path: this.path };
  }

  get text() {
    if (!this.place) return 'No odometry: the ground stands still.';
    const [x, y, yaw] = this.place;
    return `Odometry: x ${fixedText(x, 2)} m, y ${fixedText(y, 2)} m, heading ${fixedText(degrees(yaw), 0)}°`;
  }
}

class WalkerPicture {
  constructor(svg, view, legs, ground) {
    this.svg = svg;
    this.ground = ground;
    this.isAbove = view === 'above';
    this.view = VIEWS[view];
    // From the side, those of the left are behind the others.
    this.legs = [...legs].sort((a, b) => b.mount.xyz[1] - a.mount.xyz[1]);
    const middle = legs.reduce((sum, leg) => sum + leg.mount.xyz[1], 0) / legs.length;
    const isFar = (leg) => view === 'side' && leg.mount.xyz[1] > middle + 1e-9;
    const corners = legs.flatMap((leg) => {
      const [left, bottom, right, top] = leg.shape.box || [0, 0, 0, 0];
      const box = [left, right].flatMap((x) => [bottom, top].map((y) => [x, y]));
      return mounted(box, leg.mount).map(this.view);
    });
    this.drawing = new Drawing(svg, planeAround(corners, { width: 640, margin: 30 }));
    const { width, scale } = this.drawing.plane;
    // Between lines of the ground [m]: about a tenth of the view.
    this.grid = 10 ** Math.round(Math.log10(width / scale / 10));
    this.lines = this.drawing.add('path', 'ground');
    this.walked = this.drawing.add('path', 'walked');
    this.drawBody();
    this.trails = this.legs.map(() => this.drawing.add('path', 'trail thin'));
    this.bodies = this.legs.map((leg) => {
      const className = isFar(leg) ? 'leg far' : 'leg';
      return new DrawnLeg(this.drawing, leg.shape, { className, hasLetters: false });
    });
  }

  /** A line through all mounts stands for the body. */
  drawBody() {
    const places = this.legs.map((leg) => this.view(leg.mount.xyz));
    const x = places.map((at) => at[0]);
    const y = places.map((at) => at[1]);
    const [left, top] = this.drawing.at([Math.min(...x), Math.max(...y)]);
    const [right, bottom] = this.drawing.at([Math.max(...x), Math.min(...y)]);
    const body = this.drawing.add('rect', 'body');
    body.setAttribute('x', left - 12);
    body.setAttribute('y', top - 12);
    body.setAttribute('width', right - left + 24);
    body.setAttribute('height', bottom - top + 24);
    body.setAttribute('rx', 12);
  }

  /** Move the ground: from above a grid and the path walked, from the side a line with marks. */
  showGround(lowest) {
    const { ground, drawing, grid } = this;
    const { left, top, scale, width, height } = drawing.plane;
    const [right, bottom] = [left + width / scale, top - height / scale];
    if (!this.isAbove) {
      if (!Number.isFinite(lowest)) return;
      const parts = [drawing.line([[left, lowest], [right, lowest]])];
      for (let k = Math.ceil((left + ground.travel) / grid); k * grid < right + ground.travel; k += 1) {
        const x = k * grid - ground.travel;
        parts.push(drawing.line([[x, lowest], [x - 0.25 * grid, lowest - 0.25 * grid]]));
      }
      this.lines.setAttribute('d', parts.join(''));
      return;
    }
    if (!ground.place) return;
    const [x, y] = ground.place.map((value) => Math.round(value / grid));
    const reach = Math.hypot(right - left, top - bottom);
    const count = Math.ceil(reach / grid);
    const parts = [];
    for (let i = -count; i <= count; i += 1) {
      for (const ends of [[[i, -count], [i, count]], [[-count, i], [count, i]]]) {
        parts.push(drawing.line(ends.map(([u, v]) => ground.toBase([(x + u) * grid, (y + v) * grid]))));
      }
    }
    this.lines.setAttribute('d', parts.join(''));
    const at = [...ground.path, ground.place.slice(0, 2)].map((point) => ground.toBase(point));
    this.walked.setAttribute('d', drawing.line(at));
  }

  /** Show the legs; `trackOf` returns the track of one. */
  show(trackOf) {
    let lowest = Infinity;
    this.bodies.forEach((body, i) => {
      const track = trackOf(this.legs[i]);
      const { points } = track;
      const place = (some) => mounted(some, this.legs[i].mount).map(this.view);
      body.show(points && place(points));
      if (points && !this.isAbove) {
        for (const [, z] of place([track.foot])) lowest = Math.min(lowest, z);
      }
      const trail = track.trail(TRAIL);
      this.trails[i].setAttribute('d', this.drawing.line(trail.length ? place(trail) : []));
    });
    this.showGround(lowest);
  }
}
