'use strict';
/* Change points, where a dyad is in line and the motion goes on along its tangent: change_points.py. */

// Steps of derivatives, and of the growth of a discriminant, which tells a contact's order [rad].
const STENCIL_STEP = 1e-3;
// Not at whole degrees, where dyads often have theirs.
const SAMPLE_SHIFT = 0.37;
const ORDER_STEP = 1e-2;
// Change points of several dyads that are one [rad].
const SAME_ANGLE = 1e-6;
const MAX_PERIOD = 8;
// Near a change point a pose is that of the polynomial through poses at the nodes, in steps of [rad].
const NODE_STEP = 5e-3;
const NODES = [-4, -3, -2, -1, 1, 2, 3, 4];
const MAX_HALVINGS = 12;
const INTERPOLATION_ERROR = 1e-10;

/** The signs of a linkage's dyads along its motion, by its crank angle with all turns. */
class ChangePoints {
  constructor(linkage) {
    const { reference, signs } = linkage;
    Object.assign(this, { linkage, reference, signs: [...signs], points: [], cut: null });
    // Turns of the crank after which every body is back.
    this.period = linkage.isDyadic ? 1 : linkage.branch.period;
    this.cycles = signs.map(() => null);
    this.fits = new Map();
    if (!linkage.isDyadic) this.points.push(...linkage.branch.changes);
    if (linkage.atChangePoints !== SIGN && this.isSuspicious())
      linkage.blocks.forEach((block, k) => {
        if (block.isDyad && block.twoBranches) this.add(block, k);
      });
    this.spread();
  }

  /** Return the assembly at a crank angle with all its turns [rad]. */
  signsAt(alpha) {
    if (!this.points.length) return this.signs;
    const at = this.cut === null ? alpha : this.cut + modulo(alpha - this.cut, TAU);
    return this.signs.map((sign, k) => (this.flips(k, at) % 2 ? -sign : sign));
  }

  /** Return how often a dyad turned its sign from the reference to an angle. */
  flips(k, alpha) {
    if (!this.cycles[k]) return 0;
    const { offsets, span } = this.cycles[k];
    const spans = Math.floor((alpha - this.reference) / span);
    const within = alpha - this.reference - spans * span;
    return offsets.filter((offset) => offset <= within).length + spans * offsets.length;
  }

  /** Return the coordinates, or their derivatives of an order, near a change point; null elsewhere. */
  through(alpha, order = 0) {
    for (const { alpha: centre } of this.points) {
      const offset = this.offset(alpha, centre);
      if (Math.abs(offset) > NODE_STEP) continue;
      const { radius, nodes } = this.fit(centre);
      if (Math.abs(offset) > radius) return null;
      return interpolated(nodes, offset / radius, order).map((value) => value / radius ** order);
    }
    return null;
  }

  offset(alpha, centre) {
    const span = this.cut === null ? this.period * TAU : TAU;
    return alpha - centre - span * Math.round((alpha - centre) / span);
  }

  fit(centre) {
    if (!this.fits.has(centre)) {
      let radius = NODE_STEP;
      let nodes = this.nodes(centre, radius);
      for (let n = 0; n < MAX_HALVINGS && !this.isGood(centre, radius, nodes); n += 1) {
        radius /= 2;
        nodes = this.nodes(centre, radius);
      }
      this.fits.set(centre, { radius: this.isGood(centre, radius, nodes) ? radius : 0, nodes });
    }
    return this.fits.get(centre);
  }

  nodes(centre, radius) {
    const { bodies } = this.linkage.structure;
    const nodes = NODES.map((t) => this.direct(centre + t * radius));
    if (nodes.includes(null)) return null;
    for (let n = 1; n < nodes.length; n += 1)
      nodes[n] = nodes[n].map((x, j) =>
        bodies[j].slides ? x : nodes[n - 1][j] + wrap(x - nodes[n - 1][j]),
      );
    return nodes;
  }

  isGood(centre, radius, nodes) {
    const errors = [-0.5, 0.5].map((t) => {
      const x = nodes && this.direct(centre + t * radius);
      return x ? poseDistance(this.linkage, interpolated(nodes, t), x) : Infinity;
    });
    return Math.max(...errors) <= INTERPOLATION_ERROR;
  }

  /** Return the coordinates that the dyads' circles have; null where one does not close. */
  direct(alpha) {
    const { linkage } = this;
    return unlessOpen(() =>
      linkage.coordinates(placedVectors(linkage, alpha, this.signsAt(alpha))),
    );
  }

  /** Return the rates of a dyad's bodies at a change point, or with -1 those of the other way on. */
  rates({ alpha, block }, factor) {
    const { linkage } = this;
    const coordinates = (at) => {
      const signs = this.signsAt(at).map((sign, k) => (k === block - 1 ? factor * sign : sign));
      const u = placedVectors(linkage, at, signs, block);
      return linkage.blocks[block - 1].unknowns.map((j) => linkage.coordinate(u, j));
    };
    const nodes = NODES.map((t) => coordinates(alpha + t * NODE_STEP));
    const { bodies } = linkage.structure;
    return linkage.blocks[block - 1].unknowns.map((j, i) => {
      const rise = (n) => {
        const difference = nodes.at(-1 - n)[i] - nodes[n][i];
        return bodies[j].slides ? difference : wrap(difference);
      };
      // The derivative of the polynomial of degree 8 through four pairs of nodes.
      const weights = [-1 / 280, 4 / 105, -1 / 5, 4 / 5];
      return weights.reduce((sum, w, n) => sum + w * rise(n), 0) / NODE_STEP;
    });
  }

  // The search.

  /** Return what a dyad's length decides on, as its ends move with the dyads before it. */
  span(block, k, alpha) {
    const u = unlessOpen(() => placedVectors(this.linkage, alpha, this.signsAt(alpha), k));
    return u && block.solver.span(block.closure(u), u);
  }

  discriminant(block, k, alpha) {
    const m = this.span(block, k, alpha);
    return m ? block.solver.discriminant(m) : NaN;
  }

  samples(count, sampled) {
    const at = (i) => this.reference + ((i + SAMPLE_SHIFT) * TAU) / SAMPLES;
    return Array.from({ length: count }, (_, i) => sampled(at(i)));
  }

  /** Return whether a dyad comes near to being in line, in the assembly as it is: few do. */
  isSuspicious() {
    const { linkage, signs } = this;
    const dyads = linkage.blocks.filter((block) => block.isDyad && block.twoBranches);
    const rows = this.samples(SAMPLES * this.period, (alpha) => {
      const row = [];
      unlessOpen(() =>
        placedVectors(linkage, alpha, signs, linkage.blocks.length, (block, u) => {
          if (dyads.includes(block))
            row.push(block.solver.discriminant(block.solver.span(block.closure(u), u)));
        }),
      );
      return row;
    });
    return dyads.some((_, k) => dips(rows.map((row) => row[k])).length > 0);
  }

  add(block, k) {
    const { reference, period } = this;
    const span = period * TAU;
    const alphas = isDriven(block) ? this.driven(block) : this.contacts(block, k);
    const isOdd = (alpha) => isCrossing((at) => this.discriminant(block, k, at), alpha);
    const isFree = (alpha) => C.abs(this.span(block, k, alpha)) <= block.contactRounding;
    const points = alphas.map((alpha) => ({
      ...{ alpha, block: k + 1, flips: isOdd(alpha) },
      // Ends that coincide let both bodies turn freely.
      isFree: block.solver.isPinned && isFree(alpha),
    }));
    const offsets = points
      .filter(({ flips }) => flips)
      .map(({ alpha }) => modulo(alpha - reference, span))
      // The signs hold after a change point at the reference.
      .map((offset) => (offset < SAME_ANGLE ? offset + span : offset));
    this.points.push(...points);
    this.cycles[k] = { offsets, span };
    if (points.length && this.linkage.atChangePoints === CROSSED) this.signs[k] *= -1;
    if (offsets.length % 2 && this.cut === null && period < MAX_PERIOD) this.period *= 2;
  }

  /** Return where a dyad that the crank alone drives is in line, though the crank passes. */
  driven(block) {
    const { lengths, ground } = drivenLengths(block);
    const [l1, l2, l3, l4] = lengths;
    const rounding = CONTACT_ROUNDING * Math.max(...lengths);
    const alphas = [];
    const clearances = [Math.abs(l1 - l2) - Math.abs(l3 - l4), l3 + l4 - l1 - l2];
    clearances.forEach((clearance, n) => {
      const alpha = this.reference + modulo(ground + n * Math.PI - this.reference, TAU);
      if (Math.min(l1, l2) <= rounding) return;
      if (Math.abs(clearance) <= rounding)
        for (let turn = 0; turn < this.period; turn += 1) alphas.push(alpha + turn * TAU);
      else if (clearance < 0) this.cutAt(alpha);
    });
    return alphas;
  }

  cutAt(alpha) {
    if (this.cut === null) this.cut = alpha - TAU * Math.ceil((alpha - this.reference) / TAU);
  }

  contacts(block, k) {
    const rounding = block.contactRounding;
    const sampled = this.samples(SAMPLES * this.period, (alpha) => [
      alpha,
      this.span(block, k, alpha),
    ]);
    const clearances = sampled.map(([, m]) => (m ? block.solver.spanClearance(m) : -Infinity));
    const lowest = clearances.indexOf(Math.min(...clearances));
    if (!(clearances[lowest] >= -rounding)) this.cutAt(sampled[lowest][0]);
    const p = sampled.map(([, m]) => (m ? block.solver.discriminant(m) : NaN));
    return dips(p)
      .map((i) => this.refined(block, k, sampled[i][0]))
      .filter((alpha) => {
        const m = this.span(block, k, alpha);
        return m && Math.abs(block.solver.spanClearance(m)) <= rounding;
      });
  }

  /** Return the angle near another at which the length of a dyad is stationary. */
  refined(block, k, near) {
    let alpha = near;
    for (let n = 0; n < 40; n += 1) {
      const m = [-2, -1, 0, 1, 2].map((i) => this.span(block, k, alpha + i * STENCIL_STEP));
      if (m.includes(null)) return alpha;
      const sum = (weights) =>
        m.reduce((total, value, i) => C.add(total, C.times(weights[i], value)), [0, 0]);
      const slope = C.times(1 / (12 * STENCIL_STEP), sum([1, -8, 0, 8, -1]));
      const bend = C.times(1 / (12 * STENCIL_STEP ** 2), sum([-1, 16, -30, 16, -1]));
      const change = -dot(m[2], slope) / (dot(slope, slope) + dot(m[2], bend));
      if (!Number.isFinite(change)) return alpha;
      alpha += Math.min(Math.max(change, -0.02), 0.02);
      if (Math.abs(change) < 1e-14) break;
    }
    return alpha;
  }

  /** Repeat the change points of all blocks over the whole period. */
  spread() {
    const start = this.cut === null ? this.reference : this.cut;
    if (this.cut !== null) this.period = 1;
    const length = this.period * TAU;
    const all = this.points.flatMap((point) => {
      const { span } = this.cycles[point.block - 1] || { span: length };
      const first = start + modulo(point.alpha - start, span);
      const count = Math.max(1, Math.round(length / span));
      return Array.from({ length: count }, (_, n) => ({ ...point, alpha: first + n * span }));
    });
    this.points = all
      .filter(({ alpha }) => alpha < start + length)
      .sort((p, q) => p.alpha - q.alpha);
  }
}

function modulo(value, length) {
  return ((value % length) + length) % length;
}

function dot(p, q) {
  return p[0] * q[0] + p[1] * q[1];
}

/** Return what a function returns, or null where a dyad, or coupled loops, do not close. */
function unlessOpen(act) {
  try {
    return act();
  } catch (error) {
    if (error instanceof Unreachable || error instanceof LoopsOpen) return null;
    throw error;
  }
}

/** Return the indices at which values around a turn dip so deep that they may touch 0. */
function dips(values) {
  return values.flatMap((middle, i) => {
    const [left, right] = [values.at(i - 1), values[(i + 1) % values.length]];
    const isDip = middle <= left && middle <= right;
    return isDip && middle <= 0.25 * (left - 2 * middle + right) ? [i] : [];
  });
}

/** Return whether a discriminant has a root of order 2, 6, ... at an angle, and not 4, 8, ... */
function isCrossing(discriminant, alpha) {
  const sum = (step) => discriminant(alpha + step) + discriminant(alpha - step);
  return Math.round(Math.log2(sum(2 * ORDER_STEP) / sum(ORDER_STEP)) / 2) % 2 === 1;
}

/** Return the values at t, or derivatives of an order, of the polynomials through poses at the nodes. */
function interpolated(nodes, t, order = 0) {
  const weights = NODES.map((node, n) => {
    // Each factor is linear in t: the product, with its first and second derivative.
    const times = ([w, w1, w2], other, m) =>
      m === n
        ? [w, w1, w2]
        : [
            (w * (t - other)) / (node - other),
            (w1 * (t - other) + w) / (node - other),
            (w2 * (t - other) + 2 * w1) / (node - other),
          ];
    return NODES.reduce(times, [1, 0, 0])[order];
  });
  return nodes[0].map((_, j) => weights.reduce((sum, w, n) => sum + w * nodes[n][j], 0));
}
