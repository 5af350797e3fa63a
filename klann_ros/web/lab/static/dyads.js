'use strict';
/* How a dyad is placed without iteration, for each pair of joints: see dyads.py. */

/** Return how a pair of bodies is placed: see dyads.py. */
function dyadSolver(block) {
  const { structure, unknowns } = block;
  const slides = unknowns.map((j) => structure.bodies[j].slides);
  if (!slides[0] && !slides[1]) return new TwoCircles(block);
  if (slides[0] && slides[1]) return new TwoLines(block);
  const [link, slider] = slides[0] ? [unknowns[1], unknowns[0]] : unknowns;
  const kind = structure.frames[slider] === link ? LineOnLink : CircleAndLine;
  return new kind(block, link, slider, slides[0] ? -1 : 1);
}

/** Two bodies that turn: where two circles meet. */
class TwoCircles {
  constructor({ rows, unknowns, contactRounding }) {
    this.terms = unknowns.map((j) => rows[0].terms.get(j));
    this.radii = this.terms.map(C.abs);
    this.contactRounding = contactRounding;
    this.scale = this.radii[0] * this.radii[1];
    this.minLength = Math.min(...this.radii);
    // Where its span is 0 its bodies may turn freely.
    this.isPinned = true;
  }

  place(_, m, sign) {
    const joint = this.joint(m, sign);
    return [C.div(joint, this.terms[0]), C.div(C.sub(m, joint), this.terms[1])];
  }

  joint(m, sign) {
    const [p, q] = this.radii;
    const d = C.abs(m);
    const heron = (p + q - d) * (d - (p - q)) * (d + (p - q)) * (d + p + q);
    if (d > 0 && heron >= 0) {
      const a = (d * d + (p - q) * (p + q)) / (2 * d);
      const h = (sign * Math.sqrt(heron)) / (2 * d);
      const [x, y] = [m[0] / d, m[1] / d];
      return [a * x - h * y, a * y + h * x];
    }
    // In line: a change-point linkage, such as a parallelogram, passes such poses.
    if (-this.clearance(m) <= this.contactRounding && this.contactRounding < d)
      return C.times((d < Math.max(p, q) && p < q ? -p : p) / d, m);
    return [NaN, NaN];
  }

  clearance(m) {
    const [p, q] = this.radii;
    const d = C.abs(m);
    return Math.min(p + q - d, d - Math.abs(p - q));
  }

  isFar(m) {
    return C.abs(m) > this.radii[0] + this.radii[1];
  }

  /** Return the vector whose length decides whether it closes [m]. */
  span(m) {
    return m;
  }

  /** Return what is positive where it closes, and has a double root at a change point. */
  discriminant(m) {
    const [p, q] = this.radii;
    const d2 = dot(m, m);
    return ((p + q) ** 2 - d2) * (d2 - (p - q) ** 2);
  }

  spanClearance(m) {
    return this.clearance(m);
  }
}

/** Return the root of p^2 - q^2; NaN where q is longer by more than rounding. */
function clampedRoot({ contactRounding }, p, q) {
  let excess = p - q;
  if (-contactRounding <= excess && excess < 0) excess = 0;
  return Math.sqrt(excess < 0 ? NaN : excess * (p + q));
}

/** A link that turns, and a body that slides along a known line: the slider-crank's. */
class CircleAndLine {
  constructor(block, link, slider, order) {
    const { terms } = block.rows[0];
    Object.assign(this, { block, slider, order, link: terms.get(link), line: terms.get(slider) });
    this.scale = C.abs(this.link);
  }

  place(u, m, sign) {
    const rotation = rotationOf(this.block.structure, u, this.slider);
    const line = C.mul(this.line, rotation);
    const [p, q] = C.mul(m, C.conj(line));
    const along = -this.order * sign * clampedRoot(this.block, this.scale, Math.abs(q));
    return ordered(
      this.order,
      C.div(C.mul([along, q], line), this.link),
      C.times(p - along, rotation),
    );
  }

  clearance(m, u) {
    return this.spanClearance(this.span(m, u));
  }

  isFar() {
    return true;
  }

  span(m, u) {
    const line = C.mul(this.line, rotationOf(this.block.structure, u, this.slider));
    return [C.mul(m, C.conj(line))[1], 0];
  }

  discriminant(m) {
    return this.scale ** 2 - dot(m, m);
  }

  spanClearance(m) {
    return this.scale - Math.abs(m[0]);
  }

  lengths() {
    return this.scale;
  }
}

/** A body that slides along a link that turns: the inverted slider-crank's. */
class LineOnLink {
  constructor(block, link, slider, order) {
    const { terms } = block.rows[0];
    Object.assign(this, { block, order, line: terms.get(slider) });
    this.c = C.mul(terms.get(link) || [0, 0], C.conj(this.line));
    this.isPinned = true;
    this.scale = maxLength(block.structure, block.rows);
  }

  place(_, m, sign) {
    const [p, q] = this.c;
    const along = -this.order * sign * clampedRoot(this.block, C.abs(m), Math.abs(q));
    const turned = C.div(m, C.mul([along, q], this.line));
    const unit = C.times(1 / C.abs(turned), turned);
    return ordered(this.order, unit, C.times(along - p, unit));
  }

  clearance(m) {
    return C.abs(m) - Math.abs(this.c[1]);
  }

  span(m) {
    return m;
  }

  discriminant(m) {
    return dot(m, m) - this.c[1] ** 2;
  }

  spanClearance(m) {
    return this.clearance(m);
  }

  isFar() {
    return false;
  }

  lengths(m) {
    return C.abs(m);
  }
}

/** Two bodies that slide along known lines, which meet once: the Scotch yoke's. */
class TwoLines {
  constructor(block) {
    this.block = block;
    this.terms = block.unknowns.map((j) => block.rows[0].terms.get(j));
    this.twoBranches = false;
    this.scale = 1;
    this.minLength = maxLength(block.structure, block.rows);
  }

  place(u, m) {
    const frames = this.block.unknowns.map((j) => rotationOf(this.block.structure, u, j));
    const [a, b] = this.terms.map((w, k) => C.mul(w, frames[k]));
    const cross = C.cross(a, b);
    const sine = Math.abs(cross) <= 1e-12 ? NaN : cross;
    return [C.times(C.cross(m, b) / sine, frames[0]), C.times(C.cross(a, m) / sine, frames[1])];
  }

  clearance() {
    return Infinity;
  }

  isFar() {
    return false;
  }

  lengths() {
    return 1;
  }
}

function ordered(order, link, slider) {
  return order < 0 ? [slider, link] : [link, slider];
}
