'use strict';
/*
 * What a figure draws: a layer makes its nodes in the figure's drawing once, and returns a function
 * that shows the present pose. EXTENTS are points that the drawing must hold besides the linkage's.
 */

const LETTERS = { alpha: 'α', beta: 'β', gamma: 'γ', delta: 'δ', theta: 'θ' };
// Radius of the arc of an angle, and the place of its letter, in the drawing's units.
const ARC = 34;
const LETTER_RADIUS = 50;
// Length of an arrow for a speed of the size of the linkage per radian, as a part of it.
const ARROW_SCALE = 0.35;
// Force of the ground on the foot [N].
const FORCE = 100;
const CLOUD_SIZE = 120;
const CLOUD_ANGLES = 72;

function angleLetter(name) {
  const [, letters, digits] = /^([a-z]+?)(\d*)$/.exec(name) || [null, name, ''];
  return (LETTERS[letters] || letters) + Array.from(digits, (d) => '₀₁₂₃₄₅₆₇₈₉'[d]).join('');
}

/** Return the rates of all coordinates by the crank angle at a pose, the crank's first. */
function ratesOf(linkage, { u }) {
  const { structure, rows } = linkage;
  const unknowns = u.map((_, j) => j).slice(1);
  const right = jacobianOf(structure, rows, u, [0]).map(([value]) => -value);
  const { x } = solved(jacobianOf(structure, rows, u, unknowns), right);
  return x && [1, ...x];
}

/** Return the velocity of a point per radian of the crank [m]; null at a singular pose. */
function velocityOf(linkage, pose, point) {
  const rates = ratesOf(linkage, pose);
  const { terms } = linkage.pointRows[point];
  return (
    rates &&
    rates.reduce(
      (sum, rate, j) => C.add(sum, C.times(rate, columnOf(linkage.structure, terms, pose.u, j))),
      [0, 0],
    )
  );
}

/** Return the bars of the bodies whose vectors are known, and where their ends miss each other. */
function openBars({ drawing, linkage }, u) {
  const { structure, pointRows, bars } = linkage;
  const isKnown = ({ terms }) => [...terms.keys()].every((j) => u[j]);
  const lines = { bars: '', gaps: '' };
  structure.bars.forEach(({ body, bar }, n) => {
    const carrier = structure.carriers[n];
    const row = pointRows[structure.points.indexOf(bar.from)];
    if (!u[body] || (carrier !== FIXED && !u[carrier]) || !isKnown(row)) return;
    const start = vectorSum(row, u);
    const end = C.add(start, C.mul(bars[n], carrier === FIXED ? [1, 0] : u[carrier]));
    lines.bars += drawing.line([start, end]);
    const target = pointRows[structure.points.indexOf(bar.to)];
    if (!isKnown(target)) return;
    const goal = vectorSum(target, u);
    if (C.abs(C.sub(goal, end)) * drawing.plane.scale > 0.5)
      lines.gaps += drawing.line([end, goal]);
  });
  return lines;
}

/** Return the circles of a dyad's joint about its ends, where they meet, and the ends' distance. */
function dyadCircles({ linkage, pose, plan }) {
  const u = pose.u || pose.error.u || [];
  const block = linkage.blocks[(plan.dyad || 1) - 1];
  if (!(block.solver instanceof TwoCircles)) return null;
  const ends = block.names
    .slice(0, 2)
    .map((name) => linkage.pointRows[linkage.structure.points.indexOf(name)]);
  if (!ends.every(({ terms }) => [...terms.keys()].every((j) => u[j]))) return null;
  const [p, q] = ends.map((row) => vectorSum(row, u));
  const way = C.sub(q, p);
  const [r, s] = block.solver.radii;
  const joints = [1, -1].map((sign) => C.add(p, block.solver.joint(way, sign)));
  const a = (C.abs(way) ** 2 + (r - s) * (r + s)) / (2 * C.abs(way));
  const middle = C.add(p, C.times(a / C.abs(way), way));
  return { p, q, r, s, d: C.abs(way), a, middle, joints };
}

function circleLine(drawing, centre, radius) {
  const points = Array.from({ length: 97 }, (_, k) =>
    C.add(centre, C.polar(radius, (k * TAU) / 96)),
  );
  return drawing.line(points, true);
}

/** Return an arrow from a point [m] along a vector [m]. */
function arrowLine(drawing, from, vector) {
  const [x, y] = drawing.at(from);
  const [right, bottom] = drawing.at(C.add(from, vector));
  const direction = Math.atan2(bottom - y, right - x);
  const head = [2.7, -2.7].map((turn) => C.polar(11, direction + turn));
  const barbs = head.map(([dx, dy]) => `M${right} ${bottom}l${dx} ${dy}`);
  return `M${x} ${y}L${right} ${bottom}${barbs.join('')}`;
}

/** Return an arc about a point [m] from one direction to another [rad], the way round of the turn. */
function arcLine(drawing, centre, from, turn, radius = ARC) {
  const [x, y] = drawing.at(centre);
  const [startX, startY] = C.polar(radius, -from);
  const [endX, endY] = C.polar(radius, -(from + turn));
  const large = Math.abs(turn) > Math.PI ? 1 : 0;
  return `M${x + startX} ${y + startY}A${radius} ${radius} 0 ${large} ${turn > 0 ? 0 : 1} ${x + endX} ${y + endY}`;
}

/** Return the spans of a turn between the arcs of a crank. */
function spansBetween(arcs) {
  if (!arcs.length) return [[0, TAU]];
  return arcs.map(([, end], k) => [end, k + 1 < arcs.length ? arcs[k + 1][0] : arcs[0][0] + TAU]);
}

function putText(drawing, node, point, [dx, dy]) {
  const [x, y] = drawing.at(point);
  node.setAttribute('x', x + dx);
  node.setAttribute('y', y + dy);
}

/** Return a layer of one path, whose line a function returns. */
function pathLayer(className, lineOf) {
  return (figure) => {
    const node = figure.drawing.add('path', className);
    return () => node.setAttribute('d', lineOf(figure, figure.drawing) || '');
  };
}

/** Return the greatest and the least of a foot's stance, as Stance of foot_path has it. */
function stanceOf(figure) {
  return figure.once('stance', () => {
    const { linkage, turn } = figure;
    if (!turn.isTurn) return null;
    const ground = turn.y.least + (turn.y.greatest - turn.y.least) / 8;
    const speedAt = (alpha) => velocityOf(linkage, poseAt(linkage, alpha), turn.foot)[0];
    const way = Math.sign(speedAt(turn.y.leastAt));
    // Positive in the stance [m].
    const contact = (alpha) => {
      const height = ground - poseAt(linkage, alpha).points[turn.foot][1];
      return speedAt(alpha) * way > 0 ? height : -1;
    };
    const ends = [-1, 1].map((side) => {
      let inside = turn.y.leastAt;
      while (contact(inside + side * DEGREE) >= 0 && Math.abs(inside - turn.y.leastAt) < TAU)
        inside += side * DEGREE;
      return boundary(contact, inside, inside + side * DEGREE);
    });
    return { start: ends[0], end: ends[1], ground };
  });
}

/** Return numbers in [-1, 1), always the same: Kronecker's sequence of several dimensions. */
function spreadNumbers(count, dimensions) {
  let root = 2;
  for (let k = 0; k < 60; k += 1) root = (1 + root) ** (1 / (dimensions + 1));
  return Array.from({ length: count }, (_, k) =>
    Array.from({ length: dimensions }, (_, i) => 2 * (((k + 1) * root ** -(i + 1)) % 1) - 1),
  );
}

/** Return the foot paths of legs whose lengths vary by a tolerance [%]; null of one that jams. */
function cloudOf(figure) {
  const { linkage, state, turn } = figure;
  return figure.once(`cloud ${state.tolerance}`, () => {
    const { dimensions } = linkage.structure;
    const lengths = dimensions.flatMap(({ kind }, n) => (kind === 'length' ? [n] : []));
    return spreadNumbers(CLOUD_SIZE, lengths.length).map((parts) => {
      const numbers = [...linkage.numbers];
      lengths.forEach((n, i) => {
        numbers[n] *= 1 + (parts[i] * state.tolerance) / 100;
      });
      const variant = linkage.with(numbers);
      const path = [];
      for (let k = 0; k < CLOUD_ANGLES; k += 1) {
        const { error, points } = poseAt(variant, (k * TAU) / CLOUD_ANGLES);
        if (error) return null;
        path.push(points[turn.foot]);
      }
      return path;
    });
  });
}

/** Return Newton-Raphson's iterates from the figure's guess. */
function iteratesOf({ linkage, alpha, state, plan }) {
  const guess = linkage.structure.angles.slice(1).map((name) => state[name] * DEGREE);
  return newtonRaphson(linkage, [alpha, ...guess], plan.corrections || 30, 1e-12);
}

/** Return both guesses for a step of the crank, and what Newton-Raphson makes of them. */
function warmStarts({ linkage, pose, alpha, state }) {
  const step = state.step * DEGREE;
  const rates = pose.error ? null : ratesOf(linkage, pose);
  if (!rates) return null;
  const starts = { last: pose.x, tangent: pose.x.map((value, j) => value + rates[j] * step) };
  const target = poseAt(linkage, alpha + step);
  return Object.entries(starts).map(([name, x]) => {
    const start = [alpha + step, ...x.slice(1)];
    const { x: iterates, converged } = newtonRaphson(linkage, start, 30, 1e-12);
    const isRight =
      converged && !target.error && poseDistance(linkage, iterates.at(-1), target.x) < SAME_POSE;
    return { name, start, count: iterates.length - 1, converged, isRight, target };
  });
}

const EXTENTS = {
  circles: (figure) => {
    figure.pose = poseAt(figure.linkage, figure.alpha);
    const { p, q, r, s } = dyadCircles(figure);
    return [
      [p, r],
      [q, s],
    ].flatMap(([[x, y], radius]) => [
      [x - radius, y - radius],
      [x + radius, y + radius],
    ]);
  },
  loops: () => [[0, 0]],
  others: ({ linkage, turn }) =>
    turn.pieces.flatMap((poses) =>
      poses
        .filter((_, k) => k % 8 === 0)
        .flatMap(({ x }) => assemblyPoses(linkage, x[0]).flatMap(({ points }) => points)),
    ),
  walker: ({ turn }) =>
    turn.pieces.flatMap((poses) => poses.flatMap(({ points }) => points.map(([x, y]) => [-x, y]))),
};

const LAYERS = {
  /** The circle of the crank's pin, red where the crank cannot be. */
  ring: (figure) => {
    const { drawing } = figure;
    const circle = drawing.add('path', 'crank-circle');
    const dead = drawing.add('path', 'dead-arcs');
    const arc = ([from, to]) => {
      const { structure, pivots, bars } = figure.linkage;
      const axle = pivots[structure.pivots.indexOf(structure.bodies[0].points[0])];
      const count = Math.max(2, Math.ceil((to - from) / 0.05));
      const at = (k) => structure.senses[0] * (from + ((to - from) * k) / count);
      const points = Array.from({ length: count + 1 }, (_, k) =>
        C.add(axle, C.mul(bars[0], C.polar(1, at(k)))),
      );
      return drawing.line(points);
    };
    return () => {
      circle.setAttribute('d', arc([0, TAU]));
      const { isTurn, arcs } = figure.turn;
      const spans = isTurn ? [] : spansBetween(arcs);
      dead.setAttribute('d', spans.map(arc).join(''));
    };
  },

  path: pathLayer('recorded-path', ({ turn }, drawing) =>
    turn.pieces
      .map((poses) =>
        drawing.line(
          poses.map(({ points }) => points[turn.foot]),
          turn.isTurn,
        ),
      )
      .join(''),
  ),

  leg: (figure) => {
    const open = figure.drawing.add('path', 'open-bars');
    const gaps = figure.drawing.add('path', 'gaps');
    const hasLetters = !figure.plan.isPlain;
    const leg = new DrawnLeg(figure.drawing, shapeOf(figure.linkage), { hasLetters });
    return () => {
      const { pose } = figure;
      leg.show(pose.points || null);
      const lines = pose.error ? openBars(figure, pose.error.u || []) : { bars: '', gaps: '' };
      open.setAttribute('d', lines.bars);
      const circles = pose.error && pose.error.u ? dyadCircles(figure) : null;
      gaps.setAttribute('d', circles ? gapLine(figure.drawing, circles) : '');
    };
  },

  others: (figure) => {
    const ghosts = [0, 1, 2].map(
      () =>
        new DrawnLeg(figure.drawing, shapeOf(figure.linkage), {
          className: 'ghost',
          hasLetters: false,
        }),
    );
    return () => {
      const { linkage, alpha, pose } = figure;
      const shown = assemblyPoses(linkage, alpha).filter(
        ({ x }) => pose.error || poseDistance(linkage, x, pose.x) > SAME_POSE,
      );
      ghosts.forEach((ghost, k) => ghost.show(shown[k] ? shown[k].points : null));
    };
  },

  angles: (figure) => {
    const { drawing, linkage } = figure;
    const { structure } = linkage;
    const arcs = drawing.add('path', 'angle-arcs');
    const bodies = structure.bodies.flatMap((body, j) => (body.slides ? [] : [j]));
    const letters = bodies.map((j) => {
      const node = drawing.add('text', 'letter angle-letter');
      node.textContent = angleLetter(structure.angles[j]);
      return node;
    });
    return () => {
      const { pose } = figure;
      if (pose.error) {
        arcs.setAttribute('d', '');
        for (const node of letters) node.textContent = '';
        return;
      }
      const lines = bodies.map((j, k) => {
        const vertex = pose.points[structure.points.indexOf(structure.bodies[j].points[0])];
        const angle = C.arg(pose.u[j]);
        const turn = j ? angle : structure.senses[0] * (((figure.alpha % TAU) + TAU) % TAU);
        const [x, y] = drawing.at(vertex);
        letters[k].textContent = angleLetter(structure.angles[j]);
        putText(drawing, letters[k], vertex, C.polar(LETTER_RADIUS, -turn / 2));
        return `M${x} ${y}h${ARC + 8}${arcLine(drawing, vertex, 0, turn)}`;
      });
      arcs.setAttribute('d', lines.join(''));
    };
  },

  /** The vectors of each loop: those on the left of the equation, and those on its right. */
  loops: (figure) => {
    const { drawing } = figure;
    const { structure } = figure.linkage;
    const left = drawing.add('path', 'loop-left');
    const right = drawing.add('path', 'loop-right');
    return () => {
      const loop = structure.paths.loops[figure.state.loop - 1];
      const lines = { left: '', right: '' };
      if (loop && !figure.pose.error) {
        const at = (name) => figure.pose.points[structure.points.indexOf(name)];
        for (const [n, times] of loop.bars) {
          const { bar } = structure.bars[n];
          const start = at(bar.from);
          const arrow = arrowLine(drawing, start, C.sub(at(bar.to), start));
          lines[times > 0 ? 'left' : 'right'] += arrow;
        }
        for (const [place, times] of loop.pivots)
          if (times)
            lines[times > 0 ? 'left' : 'right'] += arrowLine(
              drawing,
              [0, 0],
              figure.linkage.pivots[place],
            );
      }
      left.setAttribute('d', lines.left);
      right.setAttribute('d', lines.right);
    };
  },

  /** The two circles that a dyad's joint is on, a along the line of its ends, and h beside it. */
  circles: (figure) => {
    const { drawing } = figure;
    const rings = drawing.add('path', 'reach');
    const construction = drawing.add('path', 'construction');
    const letters = ['J₊', 'J₋', 'a', 'h'].map((text) => {
      const node = drawing.add('text', 'letter angle-letter');
      node.dataset.text = text;
      return node;
    });
    return () => {
      const circles = dyadCircles(figure);
      const { p, q, r, s, middle, joints } = circles;
      rings.setAttribute('d', circleLine(drawing, p, r) + circleLine(drawing, q, s));
      const meets = joints[0].every(Number.isFinite);
      const lines = drawing.line([p, q]) + (meets ? drawing.line(joints) : '');
      construction.setAttribute('d', lines);
      const half = C.times(0.5, C.add(p, middle));
      const places = meets
        ? [...joints, half, C.times(0.5, C.add(joints[0], middle))]
        : [null, null, null, null];
      const sides = [
        [28, -6],
        [0, 22],
        [0, 18],
        [14, 0],
      ];
      letters.forEach((node, k) => {
        node.textContent = places[k] ? node.dataset.text : '';
        if (places[k]) putText(drawing, node, places[k], sides[k]);
      });
    };
  },

  /** The transmission angle between the two links at each dyad's joint. */
  transmission: (figure) => {
    const { drawing } = figure;
    const arcs = drawing.add('path', 'transmission-arcs');
    const letters = figure.linkage.blocks.map(() =>
      drawing.add('text', 'letter transmission-letter'),
    );
    return () => {
      const { linkage, pose } = figure;
      const lines = linkage.blocks.map((block, k) => {
        letters[k].textContent = '';
        if (pose.error || !(block.solver instanceof TwoCircles)) return '';
        const circles = dyadCircles({ linkage, pose, plan: { dyad: k + 1 } });
        // Which of the two is the joint of this assembly.
        const distances = circles.joints.map((joint) =>
          Math.min(...pose.points.map((point) => C.abs(C.sub(point, joint)))),
        );
        const joint = circles.joints[distances[0] <= distances[1] ? 0 : 1];
        const [from, to] = [circles.p, circles.q].map((end) => C.arg(C.sub(end, joint)));
        const turn = wrap(to - from);
        letters[k].textContent = linkage.blocks.length > 1 ? `μ${'₁₂₃₄₅'[k]}` : 'μ';
        putText(drawing, letters[k], joint, C.polar(LETTER_RADIUS, -(from + turn / 2)));
        return arcLine(drawing, joint, from, turn, 30);
      });
      arcs.setAttribute('d', lines.join(''));
    };
  },

  diagonal: (figure) => {
    const { drawing } = figure;
    const line = drawing.add('path', 'construction');
    const letter = drawing.add('text', 'letter angle-letter');
    letter.textContent = 'Z';
    return () => {
      const { p, q } = dyadCircles(figure);
      line.setAttribute('d', drawing.line([p, q]));
      putText(drawing, letter, C.times(0.5, C.add(p, q)), [12, 14]);
    };
  },

  velocity: pathLayer('velocity', ({ linkage, pose, turn }, drawing) => {
    const velocity = pose.error ? null : velocityOf(linkage, pose, turn.foot);
    if (!velocity) return '';
    return arrowLine(drawing, pose.points[turn.foot], C.times(ARROW_SCALE * 2, velocity));
  }),

  force: pathLayer('force', ({ pose, turn, state, linkage }, drawing) => {
    if (pose.error) return '';
    const force = C.polar(0.45 * linkage.size, state.force * DEGREE);
    return arrowLine(drawing, C.sub(pose.points[turn.foot], force), force);
  }),

  foot: pathLayer('recorded-foot', ({ pose, turn }, drawing) =>
    pose.error ? '' : drawing.cross(pose.points[turn.foot]),
  ),

  /** A dot every ten degrees, and the stance. */
  stance: (figure) => {
    const dots = figure.drawing.add('path', 'path-dots');
    const trail = figure.drawing.add('path', 'trail');
    return () => {
      const { linkage, turn, drawing } = figure;
      const footAt = (alpha) => poseAt(linkage, alpha).points?.[turn.foot] || null;
      const feet = figure.once('feet', () =>
        Array.from({ length: 36 }, (_, k) => footAt((k * TAU) / 36)),
      );
      dots.setAttribute('d', drawing.dots(feet.filter(Boolean)));
      const stance = stanceOf(figure);
      const line = figure.once('stance line', () =>
        Array.from({ length: 61 }, (_, k) =>
          stance ? footAt(stance.start + ((stance.end - stance.start) * k) / 60) : null,
        ),
      );
      trail.setAttribute('d', drawing.line(line));
    };
  },

  /** An iterate of Newton-Raphson, with its open loops. */
  iterate: (figure) => {
    const bars = figure.drawing.add('path', 'iterate-bars');
    const gaps = figure.drawing.add('path', 'gaps');
    return () => {
      const { x } = iteratesOf(figure);
      const iterate = x[Math.min(figure.state.iterate, x.length) - 1];
      const isFinite = iterate.every(Number.isFinite);
      const lines = isFinite
        ? openBars(figure, figure.linkage.vectors(iterate))
        : { bars: '', gaps: '' };
      bars.setAttribute('d', lines.bars);
      gaps.setAttribute('d', lines.gaps);
    };
  },

  /** The pose after a step of the crank, and both guesses for it. */
  warm: (figure) => {
    const { drawing } = figure;
    const target = new DrawnLeg(drawing, shapeOf(figure.linkage), {
      className: 'ghost',
      hasLetters: false,
    });
    const nodes = ['last', 'tangent'].map((name) => drawing.add('path', `guess-${name}`));
    const gaps = drawing.add('path', 'gaps');
    return () => {
      const starts = warmStarts(figure);
      const lines = starts
        ? starts.map(({ start }) => openBars(figure, figure.linkage.vectors(start)))
        : [];
      nodes.forEach((node, k) => node.setAttribute('d', lines[k] ? lines[k].bars : ''));
      gaps.setAttribute('d', lines.map((line) => line.gaps).join(''));
      target.show(starts ? starts[0].target.points || null : null);
    };
  },

  cloud: (figure) => {
    const node = figure.drawing.add('path', 'cloud');
    let drawn = null;
    return () => {
      const cloud = cloudOf(figure);
      if (cloud === drawn) return;
      drawn = cloud;
      const paths = cloud.filter(Boolean).map((path) => figure.drawing.line(path, true));
      node.setAttribute('d', paths.join(''));
    };
  },

  /** Four legs in two pairs, each with its mirror image on the same crank, and the ground below. */
  walker: (figure) => {
    const { drawing, linkage, turn } = figure;
    const level = turn.y.least;
    const ground = drawing.add('path', 'ground');
    const marks = drawing.add('path', 'ground-marks');
    const shape = shapeOf(linkage);
    const legs = [
      ['ghost-leg', Math.PI, 1],
      ['ghost-leg', Math.PI, -1],
      ['leg', 0, -1],
      ['leg', 0, 1],
    ].map(([className, phase, side]) => ({
      leg: new DrawnLeg(drawing, shape, { className, hasLetters: false }),
      phase,
      side,
    }));
    const walk = figure.once('walk', () => distancesOf(linkage, turn));
    return () => {
      for (const { leg, phase, side } of legs) {
        // The mirror image of a leg at pi - alpha is one at alpha.
        const alpha = side > 0 ? figure.alpha + phase : Math.PI - figure.alpha - phase;
        const { points } = poseAt(linkage, alpha);
        leg.show(points ? points.map(([x, y]) => [side * x, y]) : null);
      }
      const { left, scale, width } = drawing.plane;
      const right = left + width / scale;
      ground.setAttribute(
        'd',
        drawing.line([
          [left, level],
          [right, level],
        ]),
      );
      const pitch = turn.x.greatest - turn.x.least;
      const offset = walk(figure.alpha);
      const first = Math.ceil((left - offset) / (pitch / 4));
      const places = Array.from(
        { length: Math.ceil((4 * (right - left)) / pitch) },
        (_, k) => offset + ((first + k) * pitch) / 4,
      );
      marks.setAttribute(
        'd',
        places
          .map((x) =>
            drawing.line([
              [x, level],
              [x - 0.02, level - 0.03],
            ]),
          )
          .join(''),
      );
    };
  },
};

/** Return a function of the crank angle: how far the ground moves below the walker's lowest foot [m]. */
function distancesOf(linkage, { foot }) {
  const count = 240;
  const footAt = (k) => poseAt(linkage, (k * TAU) / count).points[foot];
  const feet = Array.from({ length: count }, (_, k) => footAt(k));
  const mirrored = feet.map((_, k) => {
    const [x, y] = feet[(count + count / 2 - k) % count];
    return [-x, y];
  });
  const half = count / 2;
  const legs = [feet, mirrored];
  const all = [...legs, ...legs.map((leg) => leg.map((_, k) => leg[(k + half) % count]))];
  const distances = [0];
  for (let k = 0; k < count; k += 1) {
    const next = (k + 1) % count;
    const lowest = all.reduce((a, b) => (b[k][1] + b[next][1] < a[k][1] + a[next][1] ? b : a));
    distances.push(distances[k] + lowest[next][0] - lowest[k][0]);
  }
  return (alpha) => {
    const turns = Math.floor(alpha / TAU);
    const place = (alpha / TAU - turns) * count;
    const k = Math.min(Math.floor(place), count - 1);
    const part = place - k;
    return turns * distances[count] + (1 - part) * distances[k] + part * distances[k + 1];
  };
}

/** Return the gap between the circles of a dyad that does not close. */
function gapLine(drawing, { p, q, r, s, d }) {
  const unit = C.times(1 / (d || 1), C.sub(q, p));
  const isInside = d < Math.abs(r - s);
  const one = C.add(p, C.times(isInside && r < s ? -r : r, unit));
  const two = C.sub(q, C.times(isInside && s <= r ? -s : s, unit));
  return drawing.line([one, two]);
}
