'use strict';
/* The leg in its plane: bodies, pivots and letters, the path of its foot and what lies behind it. */

const SVG = 'http://www.w3.org/2000/svg';
// Of the picture, before it is scaled to its place.
const WIDTH = 640;
const MARGIN = 34;
// So many points of a path are drawn; the chart of the path has them all.
const MOST_POINTS = 4000;
// The trail is what the foot did in so long [s].
const TRAIL = 0.6;

class Picture {
  /** Make the picture of a leg; the ghost is its like in another run, or null. */
  constructor(svg, leg, ghost, { small = false } = {}) {
    this.svg = svg;
    this.leg = leg;
    this.ghost = ghost;
    this.small = small;
    svg.replaceChildren();
    this.plane = planeOf([leg, ghost].filter(Boolean));
    svg.setAttribute('viewBox', `0 0 ${WIDTH} ${this.plane.height}`);
    Object.assign(svg.dataset, this.plane);
    this.drawPaths();
    this.trail = this.add('path', 'trail');
    this.bodies = leg.shape ? new Bodies(this, leg, 'leg') : null;
    // Above the leg: where they agree, it would be hidden.
    this.ghostBodies = ghost && ghost.shape ? new Bodies(this, ghost, 'ghost') : null;
    this.foot = this.add('path', 'recorded-foot');
  }

  /** Show the poses at two rows, of the leg and of the ghost. */
  show(row, ghostRow) {
    if (this.bodies) this.bodies.show(this.leg.points(row));
    if (this.ghostBodies) this.ghostBodies.show(this.ghost.points(ghostRow));
    const at = row < 0 ? null : this.leg.footAt(row);
    this.foot.setAttribute('d', at ? this.cross(at) : '');
    this.trail.setAttribute('d', row < 0 ? '' : this.line(trailRows(this.leg, row), this.leg));
  }

  drawPaths() {
    const leg = this.leg;
    if (leg.path) this.add('path', 'own-path').setAttribute('d', this.closed(leg));
    const rows = evenRows(leg.count);
    const draw = rows.length < leg.count ? this.dots : this.line;
    this.add('path', 'recorded-path').setAttribute('d', draw.call(this, rows, leg));
  }

  closed(leg) {
    const [xs, ys] = leg.path;
    const points = Array.from(xs, (x, i) => this.at([x, ys[i]]).join(' '));
    return `M${points.join('L')}${leg.shape.closed ? 'Z' : ''}`;
  }

  line(rows, leg) {
    let pen = 'M';
    const parts = [];
    for (const row of rows) {
      const at = leg.footAt(row);
      if (at)
        parts.push(
          `${pen}${this.at(at)
            .map((v) => v.toFixed(2))
            .join(' ')}`,
        );
      pen = at ? 'L' : 'M';
    }
    return parts.join('');
  }

  /** Return dots: lines between poses far apart would cross the path. */
  dots(rows, leg) {
    const feet = rows.map((row) => leg.footAt(row)).filter(Boolean);
    return feet
      .map(
        (at) =>
          `M${this.at(at)
            .map((v) => v.toFixed(2))
            .join(' ')}h0`,
      )
      .join('');
  }

  cross(at) {
    const [x, y] = this.at(at);
    return `M${x - 7} ${y}H${x + 7}M${x} ${y - 7}V${y + 7}`;
  }

  /** Return where a point (x, y) [m] is in the picture. */
  at([x, y]) {
    const { left, top, scale } = this.plane;
    return [(x - left) * scale, (top - y) * scale];
  }

  add(name, className) {
    const node = document.createElementNS(SVG, name);
    node.setAttribute('class', className);
    this.svg.append(node);
    return node;
  }
}

/** The moving part of a picture. */
class Bodies {
  constructor(picture, leg, className) {
    this.picture = picture;
    this.shape = leg.shape;
    this.group = picture.add('g', className);
    const make = (name, kind) => {
      const node = picture.add(name, kind);
      this.group.append(node);
      return node;
    };
    this.drawn = this.shape.bodies.map((body, i) => ({
      bars: body.bars,
      corners: [...new Set(body.bars.flat())],
      plate: body.bars.length > 1 ? make('path', `plate colour-${i % BODY_COLOURS}`) : null,
      line: body.line,
      rail: body.line ? make('path', `rail colour-${i % BODY_COLOURS}`) : null,
      stroke: make('path', `bar colour-${i % BODY_COLOURS}`),
    }));
    this.joints = this.shape.points.map((point, i) => {
      const isPivot = this.shape.pivots.includes(i);
      const joint = make(isPivot ? 'rect' : 'circle', isPivot ? 'pivot' : 'joint');
      joint.dataset.point = point.name;
      return joint;
    });
    const isNamed = className === 'leg' && !picture.small;
    this.letters = isNamed
      ? this.shape.points.map((point) => letter(make('text', 'letter'), point))
      : [];
  }

  show(points) {
    this.group.classList.toggle('absent', !points);
    if (!points) return;
    const at = points.map((point) => this.picture.at(point));
    for (const body of this.drawn) {
      const lines = body.bars.map(([p, q]) => `M${at[p].join(' ')}L${at[q].join(' ')}`);
      body.stroke.setAttribute('d', lines.join(''));
      if (body.rail) body.rail.setAttribute('d', `M${body.line.map((i) => at[i].join(' ')).join('L')}`);
      if (body.plate) body.plate.setAttribute('d', around(body.corners.map((i) => at[i])));
    }
    this.joints.forEach((joint, i) => place(joint, at[i]));
    this.letters.forEach((text, i) => placeLetter(text, at[i], this.freeSide(i, at)));
  }

  /** Return the direction away from the bars that meet at a point. */
  freeSide(point, at) {
    let [x, y] = [0, 0];
    for (const body of this.drawn) {
      const bars = body.line ? [body.line, ...body.bars] : body.bars;
      for (const [p, q] of bars.filter((bar) => bar.includes(point))) {
        const other = at[p === point ? q : p];
        const [dx, dy] = [at[point][0] - other[0], at[point][1] - other[1]];
        const size = Math.hypot(dx, dy) || 1;
        x += dx / size;
        y += dy / size;
      }
    }
    const size = Math.hypot(x, y);
    return size > 0.1 ? [x / size, y / size] : [0, -1];
  }
}

function letter(node, point) {
  node.textContent = point.name;
  return node;
}

function place(joint, [x, y]) {
  if (joint.tagName === 'circle') {
    joint.setAttribute('cx', x);
    joint.setAttribute('cy', y);
    joint.setAttribute('r', 5);
    return;
  }
  joint.setAttribute('x', x - 5.5);
  joint.setAttribute('y', y - 5.5);
  joint.setAttribute('width', 11);
  joint.setAttribute('height', 11);
}

function placeLetter(text, [x, y], [dx, dy]) {
  text.setAttribute('x', x + 19 * dx);
  text.setAttribute('y', y + 19 * dy);
}

/** Return a closed line through corners, in their order around the middle of them. */
function around(corners) {
  const x = corners.reduce((sum, at) => sum + at[0], 0) / corners.length;
  const y = corners.reduce((sum, at) => sum + at[1], 0) / corners.length;
  const angle = (at) => Math.atan2(at[1] - y, at[0] - x);
  const ordered = [...corners].sort((a, b) => angle(a) - angle(b));
  return `M${ordered.map((at) => at.join(' ')).join('L')}Z`;
}

/** Return rows of a leg, evenly spaced and no more than can be drawn. */
function evenRows(count) {
  const step = Math.max(count / MOST_POINTS, 1);
  return Array.from({ length: Math.floor(count / step) }, (_, i) => Math.floor(i * step));
}

function trailRows(leg, row) {
  const rows = [];
  const begin = leg.times[row] - TRAIL;
  for (let i = row; i >= 0 && leg.times[i] >= begin; i -= 1) rows.push(i);
  return rows;
}

/** Return the part of the plane that holds legs at all times: its corner [m] and its scale. */
function planeOf(legs) {
  const box = { left: Infinity, right: -Infinity, bottom: Infinity, top: -Infinity };
  for (const leg of legs) {
    for (const [x, y] of pointsOf(leg)) {
      box.left = Math.min(box.left, x);
      box.right = Math.max(box.right, x);
      box.bottom = Math.min(box.bottom, y);
      box.top = Math.max(box.top, y);
    }
  }
  if (box.left > box.right) Object.assign(box, { left: -1, right: 1, bottom: -1, top: 1 });
  const size = Math.max(box.right - box.left, box.top - box.bottom) || 1;
  // Neither flatter nor higher than fits on a screen.
  const wide = Math.max(box.right - box.left, size / 3);
  const high = Math.max(box.top - box.bottom, size / 3);
  const scale = Math.min((WIDTH - 2 * MARGIN) / wide, (1.1 * WIDTH - 2 * MARGIN) / high);
  const height = Math.round(high * scale + 2 * MARGIN);
  const x = (box.left + box.right) / 2;
  const y = (box.top + box.bottom) / 2;
  return { left: x - WIDTH / 2 / scale, top: y + height / 2 / scale, scale, height };
}

function* pointsOf(leg) {
  const step = Math.max(1, Math.floor(leg.count / 400));
  for (let row = 0; row < leg.count; row += step) {
    const foot = leg.footAt(row);
    if (foot) yield foot;
    yield* leg.points(row) || [];
  }
  if (leg.path) yield* Array.from(leg.path[0], (x, i) => [x, leg.path[1][i]]);
}
