'use strict';
/* The drawing of an exercise, in which a quantity can be shown: an angle, a point, a line, a vector. */

// Tried where the exercise gives no crank angle [deg].
const CRANK_ANGLES = Array.from({ length: 36 }, (_, n) => (60 + 10 * n) % 360);
// Radii of angles, and lengths of vectors and of the x direction, in units of the drawing.
const ARC_RADIUS = 46;
const VECTOR_LENGTH = 84;

class Figure {
  constructor(svg, exercise, isSolved) {
    const { kind, data } = exercise;
    const figures = Object.values(data.figures);
    const own = figures.find(({ kinds }) => kinds.split(/\s+/).includes(kind.name));
    this.marks = new Map();
    this.scope = own ? scopeOf(exercise, own.pose, isSolved) : {};
    this.points = own ? pointsIn(own.points, this.scope) : {};
    // Those of another pose, such as B_S, are drawn by their marks alone.
    this.names = Object.keys(this.points).filter((name) => !name.includes('_'));
    svg.toggleAttribute('hidden', !this.names.length);
    svg.replaceChildren();
    if (!this.names.length) return;
    for (const [names, mark] of Object.entries(own.marks))
      for (const name of names.split(' ')) this.marks.set(name, mark.split(' '));
    const plane = planeAround(Object.values(this.points), { margin: VECTOR_LENGTH });
    this.drawing = new Drawing(svg, plane);
    this.shown = this.drawing.add('g', 'shown');
    const chains = own.bodies.map((body) => body.split(' ').filter((name) => name in this.points));
    new DrawnLeg(this.drawing, {
      points: this.names.map((name) => ({ name })),
      pivots: own.pivots.split(' ').map((name) => this.names.indexOf(name)),
      bodies: chains.map((chain) => ({ bars: this.bars(chain), line: null })),
    }).show(this.names.map((name) => this.points[name]));
    svg.append(this.shown);
  }

  bars(chain) {
    const bars = chain.slice(1).map((name, n) => [chain[n], name]);
    return bars.map((bar) => bar.map((name) => this.names.indexOf(name)));
  }

  /** Show a quantity; nothing of one that is not in the drawing. */
  show(symbol) {
    this.shown?.replaceChildren();
    const [how, ...names] = this.markOf(symbol) ?? [];
    const isVector = how === 'vector';
    if (!how || (isVector ? names.slice(0, 1) : names).some((name) => !(name in this.points))) return;
    const at = (isVector ? names.slice(0, 1) : names).map((name) => this.drawing.at(this.points[name]));
    const path = { angle: angleTo, between: angleBetween, line: lineOver, point: pointAt, vector: pointAt }[how](...at);
    this.shown.append(this.drawing.add('path', 'shown-line'));
    this.shown.lastChild.setAttribute('d', path + (isVector ? this.vector(at[0], names.slice(1)) : ''));
  }

  vector(from, names) {
    const parts = names.map((name) => this.scope[name] ?? 0);
    const size = Math.hypot(...parts);
    if (!size) return '';
    const [dx, dy] = [(parts[0] / size) * VECTOR_LENGTH, (-parts[1] / size) * VECTOR_LENGTH];
    const [x, y] = [from[0] + dx, from[1] + dy];
    const head = [1, -1].map(
      (side) => `M${x} ${y}l${-0.14 * dx + side * 0.08 * dy} ${-0.14 * dy - side * 0.08 * dx}`,
    );
    return `M${from.join(' ')}L${x} ${y}${head.join('')}`;
  }

  /** Return the mark of a quantity: of itself, its iterate, its rate, or of the bar L_PQ. */
  markOf(symbol) {
    const plain = symbol.replace(/^(omega|epsilon)_/, '');
    const names = [symbol, plain, plain.replace(/_\d+$/, ''), symbol.replace(/(Phi_\d)\d$/, '$1')];
    const bar = symbol.match(/^L_([A-Z])([A-Z])$/);
    return bar ? ['line', bar[1], bar[2]] : names.map((name) => this.marks.get(name)).find(Boolean);
  }
}

/** Return the scope of a drawing: at the crank angle given, or at one that closes. */
function scopeOf({ kind, data, givens, worked }, pose, isSolved) {
  const solved = isSolved ? worked.scope : {};
  for (const angle of pose ? CRANK_ANGLES : []) {
    const at = { alpha: angle, theta_2: angle, ...givens };
    const calculation = attempted(() => new Calculation(data, at).work(pose));
    if (calculation) return { ...calculation.scope, ...solved };
  }
  return { ...givens, ...solved };
}

/** Return the points of which all numbers are known. */
function pointsIn(points, scope) {
  const all = { ...new Calculation({}, {}).scope, ...scope };
  const found = {};
  for (const [name, text] of Object.entries(points)) {
    const at = attempted(() => expressions(text)(all));
    if (at?.every(Number.isFinite)) found[name] = at;
  }
  return found;
}

/** Return an arc at a point from the x axis to the direction of another. */
function angleTo(from, to) {
  return arc(from, 0, Math.atan2(from[1] - to[1], to[0] - from[0]), to);
}

function angleBetween(from, first, second) {
  const [start, end] = [first, second].map((to) => Math.atan2(from[1] - to[1], to[0] - from[0]));
  return `${arc(from, start, end, second)}M${from.join(' ')}L${first.join(' ')}`;
}

function arc([x, y], start, end, to) {
  const turn = end - start - 2 * Math.PI * Math.round((end - start) / (2 * Math.PI));
  const rim = (angle, radius = ARC_RADIUS) =>
    `${x + radius * Math.cos(angle)} ${y - radius * Math.sin(angle)}`;
  const sweep = turn < 0 ? 1 : 0;
  return (
    `M${x} ${y}L${rim(start, 1.7 * ARC_RADIUS)}M${x} ${y}L${to.join(' ')}` +
    `M${rim(start)}A${ARC_RADIUS} ${ARC_RADIUS} 0 0 ${sweep} ${rim(start + turn)}`
  );
}

function lineOver(...points) {
  return `M${points.map((at) => at.join(' ')).join('L')}`;
}

function pointAt([x, y]) {
  return `M${x - 13} ${y}a13 13 0 1 0 26 0a13 13 0 1 0 -26 0`;
}
