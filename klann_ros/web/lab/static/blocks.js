'use strict';
/* What of a linkage is solved one after the other: dyads in closed form, and coupled loops. */

// Of the longest of a loop; and what misses by less than this part of it touches.
const ROUNDING = 8 * EPSILON;
const TOUCHES = 0.75;

/** A crank angle at which a dyad cannot close: by how much, and between what. */
class Unreachable extends Error {
  constructor(block, shortfall, isFar, names, u) {
    super(`dyad ${block} does not close by ${general(shortfall)} m`);
    // The vectors of what is placed so far.
    Object.assign(this, { block, shortfall, isFar, names, u: [...u] });
  }
}

/** A crank angle at which coupled loops do not close on their branch. */
class LoopsOpen extends Error {
  constructor(block, nearest) {
    super(`the coupled loops of block ${block} do not close`);
    Object.assign(this, { block, nearest });
  }
}

class Block {
  constructor(linkage, k, group) {
    const { structure } = linkage;
    this.number = k + 1;
    this.structure = structure;
    this.unknowns = group;
    this.rows = structure.paths.rows[k].map((row) => linkage.rows[row]);
    this.isDyad = this.rows.length === 1;
    this.slides = group.some((j) => structure.bodies[j].slides);
    this.outside = linkage.outside.includes(this.number);
    this.names = namesOf(structure, k);
    this.rounding = ROUNDING * longestOf(structure, this.rows);
    this.closing = this.isDyad ? closingOf(this) : null;
    this.twoBranches = !this.closing || this.closing.twoBranches !== false;
    this.scale = this.closing ? this.closing.scale : this.coupledScale();
    this.roundingOfSine =
      this.rounding / (this.closing ? this.closing.leastLength : this.longestLink());
    this.singularSine = Math.sqrt(this.roundingOfSine);
    const turning = group.filter((j) => !structure.bodies[j].slides);
    this.sense = turning.reduce((product, j) => product * structure.senses[j], 1);
  }

  /** Return what a dyad's W_a u_a + W_b u_b must be, by all others [m]. */
  way(u) {
    return C.times(-1, sumOver(this.rows[0], u, this.unknowns));
  }

  /** Return the vectors of a dyad's two bodies; it is Unreachable where they do not meet. */
  place(u, sign) {
    const way = this.way(u);
    const [a, b] = this.closing.place(u, way, sign);
    if (Number.isNaN(a[0] + a[1] + b[0] + b[1])) {
      const short = Math.max(0, -this.closing.clearance(way, u));
      throw new Unreachable(this.number, short, this.closing.isFar(way), this.names, u);
    }
    return [a, b];
  }

  columns(u) {
    return this.unknowns.map((i) => columnOf(this.structure, this.rows[0].terms, u, i));
  }

  jacobian(u) {
    return this.rows.flatMap(({ terms }) => {
      const columns = this.unknowns.map((i) => columnOf(this.structure, terms, u, i));
      return [columns.map(([re]) => re), columns.map(([, im]) => im)];
    });
  }

  /** Return the determinant over `scale`, in [-1, 1]; its sign is the assembly. */
  sine(u) {
    if (!this.closing) {
      const jacobian = this.jacobian(u);
      return (
        solved(
          jacobian,
          jacobian.map(() => 0),
        ).det / this.scale
      );
    }
    if (this.slides) {
      const sine = (this.sense * C.cross(...this.columns(u))) / this.closing.lengths(this.way(u));
      return this.twoBranches ? sine : Math.abs(sine);
    }
    const [p, q] = this.links(u);
    return (p[1] * q[0] - p[0] * q[1]) / this.scale;
  }

  links(u) {
    return this.unknowns.map((j) => C.mul(this.rows[0].terms.get(j), u[j]));
  }

  /** Return the angle between a dyad's links; of coupled loops asin of what stands for its sine. */
  transmissionAngle(u) {
    if (!this.closing) return Math.asin(Math.min(1, Math.abs(this.sine(u))));
    const [p, q] = this.slides ? this.columns(u) : this.links(u);
    const along = Math.abs(C.arg(C.mul(q, C.conj(p))));
    return this.slides || this.outside ? along : Math.PI - along;
  }

  /** Return how far a dyad's ends are inside its reach [m]; null of coupled loops. */
  clearance(u) {
    return this.closing ? this.closing.clearance(this.way(u), u) : null;
  }

  coupledScale() {
    const own = this.rows.map(({ terms }) =>
      this.unknowns.map((j) => (terms.has(j) ? C.abs(terms.get(j)) : 0)),
    );
    const longest = own.map((row) => Math.max(...row));
    const columns = this.unknowns.map((_, i) =>
      Math.hypot(...own.map((row, k) => row[i] / longest[k])),
    );
    return longest.reduce((p, x) => p * x * x, 1) * columns.reduce((p, x) => p * x, 1);
  }

  longestLink() {
    const links = this.rows.flatMap(({ terms }) =>
      this.unknowns.filter((j) => terms.has(j)).map((j) => C.abs(terms.get(j))),
    );
    return Math.max(...links);
  }
}

/** Return what the ends and the links of a block are called, by their points. */
function namesOf(structure, k) {
  const placed = new Set([...structure.pivots, ...structure.bodies[0].points]);
  for (const j of structure.groups.slice(0, k).flat())
    for (const point of structure.bodies[j].points) placed.add(point);
  const [a, b] = structure.groups[k].map((j) => structure.bodies[j]);
  if (a.slides || b.slides) {
    const [link, slider] = a.slides && !b.slides ? [b, a] : [a, b];
    const p = [...link.points, ...slider.points].find((point) => placed.has(point)) || '?';
    if (slider.along === link.name)
      return [
        p,
        slider.points.find((point) => placed.has(point)) || slider.points[0],
        link.name,
        '',
      ];
    return [p, slider.name, link.points.slice(0, 2).join(''), ''];
  }
  const joint = a.points.find((point) => b.points.includes(point) && !placed.has(point)) || '';
  const [p, q] = [a, b].map(({ points }) => points.find((point) => placed.has(point)) || '?');
  const links = [a, b].map(({ points }) =>
    points.filter((name) => name === p || name === q || name === joint).join(''),
  );
  return [p, q, ...links];
}
