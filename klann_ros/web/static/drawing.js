'use strict';
/*
 * The one renderer of legs: bodies, pivots and letters, and the lines that their feet draw. The
 * numbers may be from a run (review), from topics (view_node), or computed (the lab).
 *
 *   pointsOf(shape, x) -> [[x, y], ...]       points [m] by the coordinates, the crank's first [rad, m]
 *   planeAround(points, {width, margin}) -> plane    what holds points [m]: {left, top, scale, width, height}
 *   new Drawing(svg, plane)                   an empty drawing; svg.dataset has the plane
 *     .at([x, y]) -> [X, Y]                   metres to the drawing's units
 *     .metresAt([X, Y]) -> [x, y]             and back
 *     .add(name, className, parent) -> node   an SVG element
 *     .line(points, isClosed) -> d            a path; null among the points is a gap
 *     .dots(points) -> d                      a dot at each point
 *     .cross([x, y]) -> d                     a cross
 *   new DrawnLeg(drawing, shape, {className: 'leg' | 'ghost', hasLetters})
 *     .show(points | null)                    moves it there, or hides it
 *     .joints[i]                              the node of a point: circle.joint, or rect.pivot
 *
 * `shape` is what klann_ros.web.shape.leg_shape returns. Colours are those of theme.css; the styles
 * of lines are in drawing.css: own-path, recorded-path, trail, recorded-foot.
 */

const BODY_COLOURS = 7;
const SVG = 'http://www.w3.org/2000/svg';
// Of a drawing, before it is scaled to its place.
const WIDTH = 640;
const MARGIN = 34;

class Drawing {
  constructor(svg, plane) {
    this.svg = svg;
    this.plane = plane;
    svg.replaceChildren();
    svg.setAttribute('viewBox', `0 0 ${plane.width} ${plane.height}`);
    Object.assign(svg.dataset, plane);
  }

  at([x, y]) {
    const { left, top, scale } = this.plane;
    return [(x - left) * scale, (top - y) * scale];
  }

  metresAt([x, y]) {
    const { left, top, scale } = this.plane;
    return [left + x / scale, top - y / scale];
  }

  add(name, className, parent = this.svg) {
    const node = document.createElementNS(SVG, name);
    node.setAttribute('class', className);
    parent.append(node);
    return node;
  }

  line(points, isClosed = false) {
    let pen = 'M';
    const parts = [];
    for (const point of points) {
      if (point) parts.push(pen + this.short(point));
      pen = point ? 'L' : 'M';
    }
    return parts.join('') + (isClosed ? 'Z' : '');
  }

  dots(points) {
    return points.map((point) => `M${this.short(point)}h0`).join('');
  }

  cross(point) {
    const [x, y] = this.at(point);
    return `M${x - 7} ${y}H${x + 7}M${x} ${y - 7}V${y + 7}`;
  }

  short(point) {
    return this.at(point)
      .map((v) => v.toFixed(2))
      .join(' ');
  }
}

/** The moving part of a drawing. */
class DrawnLeg {
  constructor(drawing, shape, { className = 'leg', hasLetters = true } = {}) {
    this.drawing = drawing;
    this.shape = shape;
    this.group = drawing.add('g', className);
    const make = (name, kind) => drawing.add(name, kind, this.group);
    this.drawn = shape.bodies.map((body, i) => ({
      bars: body.bars,
      corners: [...new Set(body.bars.flat())],
      plate: body.bars.length > 1 ? make('path', `plate colour-${i % BODY_COLOURS}`) : null,
      line: body.line,
      rail: body.line ? make('path', `rail colour-${i % BODY_COLOURS}`) : null,
      stroke: make('path', `bar colour-${i % BODY_COLOURS}`),
    }));
    this.joints = shape.points.map((point, i) => {
      const isPivot = shape.pivots.includes(i);
      const joint = make(isPivot ? 'rect' : 'circle', isPivot ? 'pivot' : 'joint');
      joint.dataset.point = point.name;
      size(joint);
      return joint;
    });
    this.letters = hasLetters
      ? shape.points.map((point) => letter(make('text', 'letter'), point))
      : [];
  }

  show(points) {
    this.group.classList.toggle('absent', !points);
    if (!points) return;
    const at = points.map((point) => this.drawing.at(point));
    for (const body of this.drawn) {
      const lines = body.bars.map(([p, q]) => `M${at[p].join(' ')}L${at[q].join(' ')}`);
      body.stroke.setAttribute('d', lines.join(''));
      if (body.rail)
        body.rail.setAttribute('d', `M${body.line.map((i) => at[i].join(' ')).join('L')}`);
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

function size(joint) {
  if (joint.tagName === 'circle') {
    joint.setAttribute('r', 5);
    return;
  }
  joint.setAttribute('width', 11);
  joint.setAttribute('height', 11);
}

function place(joint, [x, y]) {
  if (joint.tagName === 'circle') {
    joint.setAttribute('cx', x);
    joint.setAttribute('cy', y);
    return;
  }
  joint.setAttribute('x', x - 5.5);
  joint.setAttribute('y', y - 5.5);
}

// Moved as a whole: a text with new coordinates is measured again.
function placeLetter(text, [x, y], [dx, dy]) {
  text.setAttribute('transform', `translate(${x + 19 * dx} ${y + 19 * dy})`);
}

/** Return a closed line through corners, in their order around the middle of them. */
function around(corners) {
  const x = corners.reduce((sum, at) => sum + at[0], 0) / corners.length;
  const y = corners.reduce((sum, at) => sum + at[1], 0) / corners.length;
  const angle = (at) => Math.atan2(at[1] - y, at[0] - x);
  const ordered = [...corners].sort((a, b) => angle(a) - angle(b));
  return `M${ordered.map((at) => at.join(' ')).join('L')}Z`;
}

/** Return where a shape's points are by its coordinates, the crank's first. */
function pointsOf(shape, x) {
  const u = x.map((_, j) => vectorOf(shape, x, j));
  return shape.points.map((point) => placed(point, u));
}

/** Return u_j = exp(i s_j x_j) of a body that turns, x_j u_f of one that slides, as (x, y). */
function vectorOf(shape, x, j) {
  const frame = shape.frames[j];
  if (frame === null) {
    const phase = shape.senses[j] * x[j];
    return [Math.cos(phase), Math.sin(phase)];
  }
  const [re, im] = frame < 0 ? [1, 0] : vectorOf(shape, x, frame);
  return [x[j] * re, x[j] * im];
}

/** Return p = q + sum of w_j u_j. */
function placed(point, vectors) {
  let [x, y] = point.at;
  for (const [j, re, im] of point.terms) {
    const [c, s] = vectors[j];
    x += re * c - im * s;
    y += re * s + im * c;
  }
  return [x, y];
}

/** Return the part of the plane that holds points: its corner [m] and its scale. */
function planeAround(points, { width = WIDTH, margin = MARGIN } = {}) {
  const box = { left: Infinity, right: -Infinity, bottom: Infinity, top: -Infinity };
  for (const [x, y] of points) {
    box.left = Math.min(box.left, x);
    box.right = Math.max(box.right, x);
    box.bottom = Math.min(box.bottom, y);
    box.top = Math.max(box.top, y);
  }
  if (box.left > box.right) Object.assign(box, { left: -1, right: 1, bottom: -1, top: 1 });
  const size = Math.max(box.right - box.left, box.top - box.bottom) || 1;
  // Neither flatter nor higher than fits on a screen.
  const wide = Math.max(box.right - box.left, size / 3);
  const high = Math.max(box.top - box.bottom, size / 3);
  const scale = Math.min((width - 2 * margin) / wide, (1.1 * width - 2 * margin) / high);
  const height = Math.round(high * scale + 2 * margin);
  const x = (box.left + box.right) / 2;
  const y = (box.top + box.bottom) / 2;
  return { left: x - width / 2 / scale, top: y + height / 2 / scale, scale, width, height };
}
