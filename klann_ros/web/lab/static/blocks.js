'use strict';
/* What of a linkage is solved one after the other: dyads in closed form, and coupled loops. */

// Of the longest of a loop: of its sum, and what misses by less touches.
const RELATIVE_ROUNDING = 8 * EPSILON;
const CONTACT_ROUNDING = 16 * EPSILON;

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
    const longest = maxLength(structure, this.rows);
    this.rounding = RELATIVE_ROUNDING * longest;
    this.contactRounding = CONTACT_ROUNDING * longest;
    this.solver = this.isDyad ? dyadSolver(this) : null;
    this.twoBranches = !this.solver || this.solver.twoBranches !== false;
    this.scale = this.solver ? this.solver.scale : this.coupledScale();
    this.roundingOfSine =
      this.rounding / (this.solver ? this.solver.minLength || this.scale : this.longestLink());
    this.singularSine = Math.sqrt(this.roundingOfSine);
    const turning = group.filter((j) => !structure.bodies[j].slides);
    this.sense = turning.reduce((product, j) => product * structure.senses[j], 1);
  }

  /** Return what a dyad's W_a u_a + W_b u_b must be, by all others [m]. */
  closure(u) {
    return C.times(-1, vectorSum(this.rows[0], u, this.unknowns));
  }

  /** Return the vectors of a dyad's two bodies; it is Unreachable where they do not meet. */
  place(u, sign) {
    const closure = this.closure(u);
    const [a, b] = this.solver.place(u, closure, sign);
    if (Number.isNaN(a[0] + a[1] + b[0] + b[1])) {
      const shortfall = Math.max(0, -this.solver.clearance(closure, u));
      throw new Unreachable(this.number, shortfall, this.solver.isFar(closure), this.names, u);
    }
    return [a, b];
  }

  columns(u) {
    return this.unknowns.map((i) => columnOf(this.structure, this.rows[0].terms, u, i));
  }

  /** Return the determinant over `scale`, in [-1, 1]; its sign is the assembly. */
  sine(u) {
    if (!this.solver) {
      const jacobian = jacobianOf(this.structure, this.rows, u, this.unknowns);
      return solved(jacobian, Array(jacobian.length).fill(0)).det / this.scale;
    }
    if (this.slides) {
      const sine =
        (this.sense * C.cross(...this.columns(u))) / this.solver.lengths(this.closure(u));
      return this.twoBranches ? sine : Math.abs(sine);
    }
    const [p, q] = this.links(u);
    return (p[1] * q[0] - p[0] * q[1]) / this.scale;
  }

  /** Return the sign of the sine; 0 at a pose that is nearly singular. */
  regularSign(u) {
    const sine = this.sine(u);
    return Math.abs(sine) > Math.max(MIN_START_SINE, this.singularSine) ? Math.sign(sine) : 0;
  }

  links(u) {
    return this.unknowns.map((j) => C.mul(this.rows[0].terms.get(j), u[j]));
  }

  /** Return the angle between a dyad's links; of coupled loops asin of what stands for its sine. */
  transmissionAngle(u) {
    if (!this.solver) return Math.asin(Math.min(1, Math.abs(this.sine(u))));
    const [p, q] = this.slides ? this.columns(u) : this.links(u);
    const deviation = Math.abs(C.arg(C.mul(q, C.conj(p))));
    return this.slides || this.outside ? deviation : Math.PI - deviation;
  }

  /** Return how far a dyad's ends are inside its reach [m]; null of coupled loops. */
  clearance(u) {
    return this.solver ? this.solver.clearance(this.closure(u), u) : null;
  }

  coupledScale() {
    const lengths = this.rows.map(({ terms }) =>
      this.unknowns.map((j) => (terms.has(j) ? C.abs(terms.get(j)) : 0)),
    );
    const longest = lengths.map((row) => Math.max(...row));
    const columns = this.unknowns.map((_, i) =>
      Math.hypot(...lengths.map((row, k) => row[i] / longest[k])),
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
  const firstPlaced = (points, otherwise = '?') => points.find((p) => placed.has(p)) || otherwise;
  if (a.slides || b.slides) {
    const [link, slider] = a.slides && !b.slides ? [b, a] : [a, b];
    const p = firstPlaced([...link.points, ...slider.points]);
    if (slider.along === link.name)
      return [p, firstPlaced(slider.points, slider.points[0]), link.name, ''];
    return [p, slider.name, link.points.slice(0, 2).join(''), ''];
  }
  const joint = a.points.find((point) => b.points.includes(point) && !placed.has(point));
  const ends = [firstPlaced(a.points), firstPlaced(b.points)];
  const links = [a, b].map(({ points }) =>
    points.filter((name) => [...ends, joint].includes(name)).join(''),
  );
  return [...ends, ...links];
}
