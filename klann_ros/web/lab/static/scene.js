'use strict';
/* The drawing: the linkage with grips, the path of its foot, other assemblies, and why it jams. */

// What can be grabbed around a joint, in the drawing's units, and at least so many pixels.
const GRIP = 17;
const LEAST_GRIP = 13;
const SMALL_STEP = 0.002;

/** Return the pixels of a unit of a drawing, which is as large as fits. */
function pixelsPerUnit(svg, { plane }) {
  const { width, height } = svg.getBoundingClientRect();
  return Math.min(width / plane.width, height / plane.height);
}

/** Return where a pointer is in a drawing [m]. */
function pointerMetres(svg, drawing, event) {
  const box = svg.getBoundingClientRect();
  const { width, height } = drawing.plane;
  // The drawing is in the middle.
  const scale = pixelsPerUnit(svg, drawing);
  const x = (event.clientX - box.left - (box.width - scale * width) / 2) / scale;
  const y = (event.clientY - box.top - (box.height - scale * height) / 2) / scale;
  return drawing.metresAt([x, y]);
}

class Scene {
  constructor(svg, lab) {
    this.svg = svg;
    this.lab = lab;
    this.hasOthers = false;
    this.iterate = null;
    lab.on('linkage', () => {
      // They are another linkage's.
      this.iterate = null;
      this.otherPoses = [];
      this.fit();
    });
    lab.on('turn', () => this.showTurn());
    lab.on('numbers', () => this.show());
    lab.on('pose', () => this.show());
  }

  /** Draw all again, in a plane that holds all that the linkage reaches and why it jams. */
  fit() {
    const { lab } = this;
    const isCurrent = lab.turn && lab.turn.linkage === lab.linkage;
    const turn = isCurrent ? lab.turn : turnOf(lab.linkage, reachableArcs(lab.linkage), 60);
    const points = turn.pieces.flatMap((poses) =>
      poses.filter((_, k) => k % 4 === 0).flatMap((pose) => pose.points),
    );
    points.push(...(lab.pose.points || this.jamExtent()));
    const finite = points.filter((point) => point.every(Number.isFinite));
    this.drawing = new Drawing(
      this.svg,
      planeAround(finite.length ? [...finite, ...lab.linkage.pivots] : lab.linkage.pivots, {
        margin: 46,
      }),
    );
    const add = (name, className) => this.drawing.add(name, className);
    this.circle = add('path', 'crank-circle');
    this.dead = add('path', 'dead-arcs');
    this.path = add('path', 'recorded-path');
    this.others = [];
    this.othersGroup = add('g', 'others');
    this.reach = add('path', 'reach');
    this.known = add('path', 'open-bars');
    this.links = add('path', 'open-links');
    this.names = add('g', 'open-names');
    this.leg = new DrawnLeg(this.drawing, lab.shape, { className: 'leg' });
    this.foot = add('path', 'recorded-foot');
    this.iterateBars = add('path', 'iterate-bars');
    this.gaps = add('path', 'gaps');
    this.addGrips();
    this.showTurn();
    this.show();
  }

  /** Return points around what is drawn where it jams. */
  jamExtent() {
    const { linkage, pose } = this.lab;
    const u = pose.error.u || [];
    const known = linkage.pointRows.filter(({ terms }) => [...terms.keys()].every((j) => u[j]));
    const circles = this.jamCircles();
    return [
      ...known.map((row) => vectorSum(row, u)),
      ...circles.flatMap(([[x, y], r]) => [
        [x - r, y - r],
        [x + r, y + r],
      ]),
    ];
  }

  /** Return the circles [centre, radius] that the joint of the open dyad should be on. */
  jamCircles() {
    const { error } = this.lab.pose;
    const { blocks, structure, pointRows } = this.lab.linkage;
    const dyad = error && error.u ? blocks[error.block - 1] : null;
    if (!dyad || !(dyad.solver instanceof TwoCircles)) return [];
    const ends = error.names.slice(0, 2).map((name) => pointRows[structure.points.indexOf(name)]);
    return ends.map((row, k) => [vectorSum(row, error.u), dyad.solver.radii[k]]);
  }

  addGrips() {
    const { structure } = this.lab.linkage;
    const scale = this.svg.clientWidth / this.drawing.plane.width || 1;
    this.grips = structure.points.map((name, i) => {
      const grip = this.drawing.add('circle', 'grip');
      grip.setAttribute('r', Math.max(GRIP, LEAST_GRIP / scale));
      grip.setAttribute('tabindex', '0');
      grip.setAttribute('role', 'button');
      grip.dataset.grip = name;
      grip.addEventListener('pointerdown', (event) => this.grab(event, i));
      grip.addEventListener('keydown', (event) => this.push(event, i));
      for (const name of ['keyup', 'blur']) grip.addEventListener(name, () => this.lab.commit());
      return grip;
    });
    this.nameGrips();
  }

  nameGrips() {
    const names = this.lab.linkage.structure.points;
    this.grips.forEach((grip, i) => grip.setAttribute('aria-label', say('point', names[i])));
  }

  /** Follow the pointer with a point until it is let go. */
  grab(event, i) {
    if (event.button) return;
    const grip = event.currentTarget;
    event.preventDefault();
    grip.focus({ preventScroll: true });
    grip.setPointerCapture(event.pointerId);
    const begin = pointerMetres(this.svg, this.drawing, event);
    const at = this.pointAt(i);
    const step = roundStep(1 / (pixelsPerUnit(this.svg, this.drawing) * this.drawing.plane.scale));
    this.lab.begin();
    const move = (moved) => {
      const [x, y] = C.sub(pointerMetres(this.svg, this.drawing, moved), begin);
      // An undo meanwhile has ended the edit.
      this.lab.begin();
      this.lab.isDragged = true;
      this.lab.drag(i, [at[0] + x, at[1] + y], step);
    };
    const stop = () => {
      this.lab.isDragged = false;
      this.lab.commit();
      grip.removeEventListener('pointermove', move);
      for (const name of ['pointerup', 'pointercancel']) grip.removeEventListener(name, stop);
    };
    grip.addEventListener('pointermove', move);
    for (const name of ['pointerup', 'pointercancel']) grip.addEventListener(name, stop);
  }

  push(event, i) {
    const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[
      event.key
    ];
    if (!way || event.altKey || event.ctrlKey || event.metaKey) return;
    event.preventDefault();
    const step = roundStep(SMALL_STEP * this.lab.linkage.size);
    this.lab.begin();
    const target = C.add(this.pointAt(i), C.times(step * (event.shiftKey ? 10 : 1), way));
    this.lab.drag(i, target, step);
  }

  pointAt(i) {
    const { linkage, pose, lastGood } = this.lab;
    const place = linkage.structure.pivots.indexOf(linkage.structure.points[i]);
    return place >= 0 ? linkage.pivots[place] : (pose.points || lastGood.points)[i];
  }

  showTurn() {
    const { turn, linkage } = this.lab;
    if (!turn) return;
    const lines = turn.pieces.map((poses) =>
      this.drawing.line(
        poses.map((pose) => pose.points[turn.foot]),
        turn.isTurn,
      ),
    );
    this.path.setAttribute('d', lines.join(''));
    const dead = turn.isTurn ? '' : this.deadArcs(turn.arcs);
    this.dead.setAttribute('d', dead);
    this.circle.setAttribute('d', this.arcOfCrank(linkage, [0, TAU]));
  }

  deadArcs(arcs) {
    if (!arcs.length) return this.arcOfCrank(this.lab.linkage, [0, TAU]);
    return arcs
      .map(([, end], k) => {
        const next = arcs[(k + 1) % arcs.length][0] + (k + 1 === arcs.length ? TAU : 0);
        return next > end ? this.arcOfCrank(this.lab.linkage, [end, next]) : '';
      })
      .join('');
  }

  arcOfCrank({ structure, pivots, bars }, [start, end]) {
    const axle = pivots[structure.pivots.indexOf(structure.bodies[0].points[0])];
    const count = Math.max(2, Math.ceil((end - start) / 0.05));
    const points = Array.from({ length: count + 1 }, (_, k) => {
      const u = C.polar(1, structure.senses[0] * (start + ((end - start) * k) / count));
      return C.add(axle, C.mul(bars[0], u));
    });
    return this.drawing.line(points);
  }

  show() {
    const { pose, linkage } = this.lab;
    this.leg.show(pose.points || null);
    this.svg.classList.toggle('jammed', Boolean(pose.error));
    const foot = linkage.structure.points.indexOf(linkage.structure.foot);
    this.foot.setAttribute('d', pose.points ? this.drawing.cross(pose.points[foot]) : '');
    this.showJam();
    this.showIterate();
    this.grips.forEach((grip, i) => {
      const [x, y] = this.drawing.at(this.pointAt(i));
      grip.setAttribute('cx', x);
      grip.setAttribute('cy', y);
      const isPivot = linkage.structure.pivots.includes(linkage.structure.points[i]);
      grip.classList.toggle('absent', Boolean(pose.error) && !isPivot);
    });
    if (this.hasOthers) this.showOthers(this.otherPoses || []);
  }

  /** Draw what is placed, and how far the circles of the dyad that fails are from meeting. */
  showJam() {
    const { error } = this.lab.pose;
    const u = (error && error.u) || [];
    this.known.setAttribute('d', error ? this.openBars(u).bars : '');
    this.nameKnown(error ? u : null);
    const circles = this.jamCircles();
    const drawn = circles.length ? this.circlesOf(circles) : { rings: '', links: '', gap: '' };
    this.reach.setAttribute('d', drawn.rings);
    this.links.setAttribute('d', drawn.links);
    this.gaps.setAttribute('d', drawn.gap);
  }

  /** Write the names of the points that are placed, pivots as squares. */
  nameKnown(u) {
    this.names.replaceChildren();
    if (!u) return;
    const { structure, pointRows } = this.lab.linkage;
    structure.points.forEach((name, i) => {
      if (![...pointRows[i].terms.keys()].every((j) => u[j])) return;
      const [x, y] = this.drawing.at(vectorSum(pointRows[i], u));
      if (structure.pivots.includes(name)) {
        const square = this.drawing.add('rect', 'pivot', this.names);
        for (const [key, value] of Object.entries({
          x: x - 5.5,
          y: y - 5.5,
          width: 11,
          height: 11,
        }))
          square.setAttribute(key, value);
      }
      const text = this.drawing.add('text', 'letter', this.names);
      text.textContent = name;
      text.setAttribute('x', x - 15);
      text.setAttribute('y', y - 13);
    });
  }

  circlesOf([[p, r], [q, s]]) {
    const way = C.sub(q, p);
    const d = C.abs(way);
    const unit = d > 0 ? C.times(1 / d, way) : [1, 0];
    // Where the circles are nearest to each other.
    const isInside = d < Math.abs(r - s);
    const one = C.add(p, C.times(isInside && r < s ? -r : r, unit));
    const two = C.sub(q, C.times(isInside && s <= r ? -s : s, unit));
    return {
      rings: this.ring(p, r) + this.ring(q, s),
      links: this.drawing.line([p, one]) + this.drawing.line([q, two]),
      gap: this.drawing.line([one, two]),
    };
  }

  ring(centre, radius) {
    const points = Array.from({ length: 97 }, (_, k) =>
      C.add(centre, C.polar(radius, (k * TAU) / 96)),
    );
    return this.drawing.line(points, true);
  }

  /** Return the bars of the bodies whose vectors are known, and where their ends miss each other. */
  openBars(u) {
    const { structure, pointRows, bars } = this.lab.linkage;
    const isKnown = (row) => [...row.terms.keys()].every((j) => u[j]);
    const found = { bars: '', gaps: '' };
    structure.bars.forEach(({ body, bar }, n) => {
      const carrier = structure.carriers[n];
      if ((carrier !== FIXED && !u[carrier]) || !u[body]) return;
      const row = pointRows[structure.points.indexOf(bar.from)];
      if (!isKnown(row)) return;
      const start = vectorSum(row, u);
      const end = C.add(start, C.mul(bars[n], carrier === FIXED ? [1, 0] : u[carrier]));
      found.bars += this.drawing.line([start, end]);
      const other = pointRows[structure.points.indexOf(bar.to)];
      if (!isKnown(other)) return;
      const meant = vectorSum(other, u);
      if (C.abs(C.sub(meant, end)) * this.drawing.plane.scale > 0.5)
        found.gaps += this.drawing.line([end, meant]);
    });
    return found;
  }

  /** Draw an iterate of Newton-Raphson, with the gaps that are left; null for none. */
  showIterate() {
    const isDrawn = this.iterate && this.iterate.every(Number.isFinite);
    const found = isDrawn
      ? this.openBars(this.lab.linkage.vectors(this.iterate))
      : { bars: '', gaps: '' };
    this.iterateBars.setAttribute('d', found.bars);
    if (isDrawn) this.gaps.setAttribute('d', found.gaps);
    else if (!this.lab.pose.error) this.gaps.setAttribute('d', '');
  }

  showOthers(poses) {
    this.otherPoses = poses;
    const shown = this.hasOthers
      ? poses.filter(
          (pose) =>
            String(pose.signs) !== String(this.lab.pose.signs) || !this.lab.linkage.isDyadic,
        )
      : [];
    while (this.others.length < shown.length && this.others.length < 8) {
      const ghost = new DrawnLeg(this.drawing, this.lab.shape, {
        className: 'ghost',
        hasLetters: false,
      });
      this.othersGroup.append(ghost.group);
      this.others.push(ghost);
    }
    this.others.forEach((ghost, k) => ghost.show(shown[k] ? shown[k].points : null));
  }
}
