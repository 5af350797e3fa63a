'use strict';
/* A linkage ready to be solved: its structure, its numbers, its branch; see linkage.py. */

const [SMALLEST, LARGEST] = [1e-60, 1e60];
const MAX_START_ITERATIONS = 50;
const MIN_START_SINE = 1e-6;
// How the motion goes on at a change point.
const [PARALLEL, CROSSED, SIGN] = ['parallel', 'crossed', 'sign'];

class Linkage {
  /**
   * `signs` is the assembly at the crank angle `reference`; without it the pose that Newton-Raphson
   * reaches from `start` tells it.
   */
  constructor(structure, numbers, options = {}) {
    const { signs = null, start = null, name = '', outside = [] } = options;
    const { atChangePoints = PARALLEL, reference = 0 } = options;
    this.structure = structure;
    this.numbers = checkedNumbers(structure, numbers);
    Object.assign(this, { name, outside, startGuess: start, atChangePoints });
    this.reference = start ? start[0] : reference;
    [this.pivots, this.bars] = linkVectors(structure, this.numbers);
    structure.dimensions.forEach(({ kind, place, name: what }, n) => {
      if (kind === 'brace' && Number.isNaN(this.bars[place][0]))
        refuseDimension(
          what,
          this.numbers[n],
          kind,
          'this brace and its bar do not meet',
          'esta escora e a sua barra não se encontram',
        );
    });
    const { paths } = structure;
    this.rows = paths.loops.map((path) => pathTerms(structure, path, this.pivots, this.bars));
    this.pointRows = paths.points.map((path) =>
      pathTerms(structure, path, this.pivots, this.bars),
    );
    this.blocks = structure.groups.map((group, k) => new Block(this, k, group));
    this.size = maxLength(structure, this.rows);
    this.signs = signs || this.signsAtStart();
  }

  get isDyadic() {
    return this.structure.isDyadic;
  }

  /** Return the pose that Newton-Raphson reaches from the start, the crank's angle first. */
  get start() {
    if (!this.found) this.found = this.assembled();
    return this.found;
  }

  /** Return it with other numbers; its assembly, or its start where loops are coupled, stays. */
  with(numbers, branch = { signs: this.signs }) {
    const chosen = this.isDyadic ? branch : { start: this.start };
    return new Linkage(this.structure, numbers, { ...this.kept, ...chosen });
  }

  get kept() {
    const { name, outside, atChangePoints, reference } = this;
    return { name, outside, atChangePoints, reference };
  }

  /** Return the change points, where dyads turn their signs. */
  get changes() {
    if (!this.passed) this.passed = new ChangePoints(this);
    return this.passed;
  }

  /** Return the assembly at a crank angle [rad], as a linkage of its own has it. */
  branchAt(alpha, signs = this.changes.signsAt(alpha)) {
    const isCrossed = this.atChangePoints === CROSSED;
    return { signs, reference: alpha, atChangePoints: isCrossed ? PARALLEL : this.atChangePoints };
  }

  get branch() {
    if (!this.followed) {
      const number = this.blocks.findLastIndex((block) => !block.isDyad) + 1;
      const [structure, bodies] = this.structure.head(number);
      this.headBodies = bodies;
      this.followed = new Branch(this.head(number, structure, bodies), number);
    }
    return this.followed;
  }

  /** Return the linkage of the first so many blocks, in which all else is left out. */
  head(count, structure, bodies) {
    if (count === this.blocks.length) return this;
    const bars = this.structure.bars.flatMap(({ body }, n) => (bodies.includes(body) ? [n] : []));
    const numberOf = new Map(
      this.structure.dimensions.map(({ kind, place }, n) => [`${kind} ${place}`, this.numbers[n]]),
    );
    const numbers = structure.dimensions.map(({ kind, place }) =>
      numberOf.get(`${kind} ${'xy'.includes(kind) ? place : bars[place]}`),
    );
    const start = bodies.map((j) => this.start[j]);
    const { atChangePoints } = this;
    return new Linkage(structure, numbers, { signs: this.signs.slice(0, count), start, atChangePoints });
  }

  // Poses, by the vectors u_j of all bodies: see joints.py.

  vectors(x) {
    const { structure } = this;
    const u = x.map((value, j) =>
      structure.bodies[j].slides ? null : C.polar(1, structure.senses[j] * value),
    );
    return u.map((value, j) => value || C.times(x[j], rotationOf(structure, u, j)));
  }

  coordinate(u, j) {
    const { structure } = this;
    if (structure.bodies[j].slides) return C.mul(u[j], C.conj(rotationOf(structure, u, j)))[0];
    return wrap(structure.senses[j] * C.arg(u[j]));
  }

  coordinates(u) {
    return u.map((_, j) => this.coordinate(u, j));
  }

  points(u) {
    return this.pointRows.map((row) => vectorSum(row, u));
  }

  /** Return f(x), and Phi = df/dx without the crank's column: of each loop x, then y. */
  equations(x) {
    const u = this.vectors(x);
    const gaps = this.rows.map((row) => vectorSum(row, u));
    const unknowns = u.map((_, j) => j).slice(1);
    return { u, f: gaps.flat(), phi: jacobianOf(this.structure, this.rows, u, unknowns) };
  }

  assembled() {
    refuseUnless(
      this.startGuess,
      'it has no start, which its coupled loops need',
      'falta o start, de que as suas malhas acopladas precisam',
    );
    const iterates = newtonRaphson(this, this.startGuess, MAX_START_ITERATIONS, 1e-9);
    if (!iterates.converged) refuseAssembly(general((this.startGuess[0] * 360) / TAU));
    return this.wrapped(iterates.x.at(-1));
  }

  /** Return coordinates with all angles but the crank's in (-pi, pi]. */
  wrapped(x) {
    const { bodies } = this.structure;
    return x.map((value, j) => (!j || bodies[j].slides ? value : wrap(value)));
  }

  signsAtStart() {
    const u = this.vectors(this.start);
    return this.blocks.map((block) => {
      const sign = block.regularSign(u);
      refuseUnless(
        sign,
        'its start pose is singular, which leaves the branch open: give another',
        'a posição do start é singular, e não diz qual é a montagem: dê outra',
      );
      return sign;
    });
  }
}

function refuseAssembly(degrees) {
  throw new Refusal(
    `it cannot be assembled near its start: Newton-Raphson finds no pose at the crank angle ${degrees}°; check its lengths and these angles`,
    `não pode ser montado perto do start: Newton-Raphson não acha posição no ângulo ${degrees.replace('.', ',')}° da manivela; confira os comprimentos e estes ângulos`,
  );
}

function checkedNumbers({ dimensions }, numbers) {
  return dimensions.map(({ name, kind }, n) => {
    const value = numbers[n];
    const size = Math.abs(value);
    const require = (condition, en, pt) => {
      if (!condition) refuseDimension(name, value, kind, en, pt);
    };
    require(Number.isFinite(value), 'it must be a finite number', 'tem de ser um número finito');
    require(!['length', 'brace'].includes(kind) ||
      value > 0, 'a length must be > 0', 'um comprimento tem de ser > 0');
    require(kind === 'bend' ||
      value === 0 ||
      (SMALLEST <= size &&
        size <=
          LARGEST), 'it must be within 1e-57 .. 1e+63 mm', 'tem de estar entre 1e-57 e 1e+63 mm');
    require(kind !== 'bend' ||
      size <=
        TAU, 'an angle between bars must be within ±360°', 'um ângulo entre barras tem de estar entre ±360°');
    return value;
  });
}

/** Refuse a dimension, in the page's units. */
function refuseDimension(name, value, kind, en, pt) {
  const shown = general(value * (kind === 'bend' ? 360 / TAU : 1000));
  const unit = kind === 'bend' ? '°' : ' mm';
  const translated = name.replace(/^bend of/, 'ângulo').replace(/^direction of/, 'direção');
  throw new Refusal(
    `${name} = ${shown}${unit}: ${en}`,
    `${translated} = ${shown.replace('.', ',')}${unit}: ${pt}`,
  );
}

/** Return the pivots and the bars as vectors, each bar in the frame of its body [m]. */
function linkVectors(structure, numbers) {
  const numberOf = new Map(
    structure.dimensions.map(({ kind, place }, n) => [`${kind} ${place}`, numbers[n]]),
  );
  const number = (kind, place) => numberOf.get(`${kind} ${place}`) || 0;
  const pivots = structure.pivots.map((_, place) => [number('x', place), number('y', place)]);
  const places = structure.bodies.map(() => new Map());
  const bars = structure.bars.map(({ body, bar }, n) => {
    const own = places[body];
    if (structure.isLine[n]) {
      own.set(bar.to, [0, 0]);
      return C.polar(1, number('bend', n));
    }
    if (!own.has(bar.from)) own.set(bar.from, [0, 0]);
    const start = own.get(bar.from);
    const length = number('length', n);
    const vector = bar.brace
      ? triangleApex(
          C.sub(own.get(bar.brace.from), start),
          length,
          number('brace', n),
          bar.brace.side === 'left' ? 1 : -1,
        )
      : C.polar(length, number('bend', n));
    own.set(bar.to, C.add(start, vector));
    return vector;
  });
  return [pivots, bars];
}

/** Return J - P of a triangle P-J-Q with Q - P and both other sides; NaN where there is none. */
function triangleApex(base, p, q, side) {
  const d2 = C.abs(base) ** 2;
  const root = Math.sqrt(((p + q) ** 2 - d2) * (d2 - (p - q) ** 2));
  return C.mul([0.5 + ((p - q) * (p + q)) / (2 * d2), (side * root) / (2 * d2)], base);
}

/** Return what each body adds to a path, and what does not move adds [m]. */
function pathTerms(structure, path, pivots, bars) {
  const terms = new Map();
  for (const [n, times] of path.bars) {
    const body = structure.carriers[n];
    terms.set(body, C.add(terms.get(body) || [0, 0], C.times(times, bars[n])));
  }
  let constant = terms.get(FIXED) || [0, 0];
  terms.delete(FIXED);
  for (const [place, times] of path.pivots)
    constant = C.add(constant, C.times(times, pivots[place]));
  return { terms, constant };
}

function vectorSum({ terms, constant }, u, without = []) {
  let sum = constant;
  for (const [j, w] of terms) if (!without.includes(j)) sum = C.add(sum, C.mul(w, u[j]));
  return sum;
}

/** Return the vector of what a body that slides is turned with. */
function rotationOf(structure, u, j) {
  const own = structure.frames[j];
  return own === FIXED ? [1, 0] : u[own];
}

/** Return by what a sum of W_j u_j changes with the coordinate of a body. */
function columnOf(structure, terms, u, i) {
  let column = [0, 0];
  for (const [j, w] of terms) {
    const slides = structure.bodies[j].slides;
    let tangent = null;
    if (slides && i === j) tangent = rotationOf(structure, u, j);
    else if (i === structure.frames[j]) tangent = C.mul([0, structure.senses[i]], u[j]);
    if (tangent) column = C.add(column, C.mul(w, tangent));
  }
  return column;
}

/** Return the derivatives of rows by the coordinates of some bodies: of each row x, then y. */
function jacobianOf(structure, rows, u, unknowns) {
  return rows.flatMap(({ terms }) => {
    const columns = unknowns.map((i) => columnOf(structure, terms, u, i));
    return [0, 1].map((axis) => columns.map((column) => column[axis]));
  });
}

/** Return the longest vector of loops [m]; those along lines have no length of their own. */
function maxLength({ bodies }, rows) {
  const lengths = rows.flatMap(({ terms, constant }) => [
    C.abs(constant),
    ...[...terms].filter(([j]) => !bodies[j].slides).map(([, w]) => C.abs(w)),
  ]);
  return Math.max(...lengths);
}
