'use strict';
/* The leg of a run in its plane, with the path and the trail of its foot. */

// Maximum number of drawn points of a path; the path chart has all of them.
const MAX_DRAWN_POINTS = 4000;
// Duration of the trail behind the foot [s].
const TRAIL_TIME = 0.6;

class Picture {
  /** Make the picture of a leg; `ghost` is the leg of another run, or null. */
  constructor(svg, leg, ghost, { small = false } = {}) {
    this.leg = leg;
    this.ghost = ghost;
    this.drawing = new Drawing(svg, planeAround(reached([leg, ghost].filter(Boolean))));
    this.drawPaths();
    this.trail = this.drawing.add('path', 'trail');
    const drawn = (one, className, hasLetters) =>
      one && one.shape ? new DrawnLeg(this.drawing, one.shape, { className, hasLetters }) : null;
    this.bodies = drawn(leg, 'leg', !small);
    // Above the leg: where they agree, it would be hidden.
    this.ghostBodies = drawn(ghost, 'ghost', false);
    this.foot = this.drawing.add('path', 'recorded-foot');
  }

  /** Show the poses at two rows, of the leg and of the ghost. */
  show(row, ghostRow) {
    if (this.bodies) this.bodies.show(this.leg.points(row));
    if (this.ghostBodies) this.ghostBodies.show(this.ghost.points(ghostRow));
    const at = row < 0 ? null : this.leg.footAt(row);
    this.foot.setAttribute('d', at ? this.drawing.cross(at) : '');
    const trail = row < 0 ? [] : this.feet(trailRows(this.leg, row));
    this.trail.setAttribute('d', this.drawing.line(trail));
  }

  drawPaths() {
    const { leg, drawing } = this;
    if (leg.path) {
      const own = Array.from(leg.path[0], (x, i) => [x, leg.path[1][i]]);
      drawing.add('path', 'own-path').setAttribute('d', drawing.line(own, leg.shape.closed));
    }
    const rows = evenRows(leg.count);
    // Lines between poses far apart would cross the path.
    const isWhole = rows.length === leg.count;
    const feet = this.feet(rows);
    const path = isWhole ? drawing.line(feet) : drawing.dots(feet.filter(Boolean));
    drawing.add('path', 'recorded-path').setAttribute('d', path);
  }

  feet(rows) {
    return rows.map((row) => this.leg.footAt(row));
  }
}

/** Return rows of a leg, evenly spaced, at most as many as are drawn. */
function evenRows(count) {
  const step = Math.max(count / MAX_DRAWN_POINTS, 1);
  return Array.from({ length: Math.floor(count / step) }, (_, i) => Math.floor(i * step));
}

function trailRows(leg, row) {
  const rows = [];
  const begin = leg.times[row] - TRAIL_TIME;
  for (let i = row; i >= 0 && leg.times[i] >= begin; i -= 1) rows.push(i);
  return rows;
}

/** Return the points that legs reach at all times. */
function* reached(legs) {
  for (const leg of legs) {
    const step = Math.max(1, Math.floor(leg.count / 400));
    for (let row = 0; row < leg.count; row += step) {
      const foot = leg.footAt(row);
      if (foot) yield foot;
      yield* leg.points(row) || [];
    }
    if (leg.path) yield* Array.from(leg.path[0], (x, i) => [x, leg.path[1][i]]);
  }
}
