'use strict';
/* A path for the foot, drawn by hand or written as points, and the requirements of it for `design`. */

// Points of a saved path, and of the plane around the present path.
const PATH_POINTS = 48;
const PLANE_MARGIN = 140;
// Per cent by which the dimensions of the linkage may vary.
const VARIED = 40;

/** Return points at even steps along a closed polygon. */
function evenly(points, count) {
  const ring = [...points, points[0]];
  const along = [0];
  for (let k = 1; k < ring.length; k++)
    along.push(along[k - 1] + C.abs(C.sub(ring[k], ring[k - 1])));
  const total = along[along.length - 1];
  let k = 0;
  return Array.from({ length: count }, (_, n) => {
    const wanted = (n * total) / count;
    while (along[k + 1] < wanted) k++;
    const part = (wanted - along[k]) / (along[k + 1] - along[k] || 1);
    return C.add(ring[k], C.times(part, C.sub(ring[k + 1], ring[k])));
  });
}

/** Return the points [m] in a text: two numbers a line [mm], as the page's language writes them. */
function pointsOf(text) {
  const lines = text.split('\n').filter((line) => line.trim());
  return lines.map((line) => {
    const numbers = line.trim().split(/[;\s]+/).map((word) => quantityOf(word, 'mm'));
    refuseUnless(
      numbers.length === 2 && numbers.every((number) => Number.isFinite(number)),
      `${printable(line)} must be two numbers, x and y [mm]`,
      `${printable(line)} tem de ser dois números, x e y [mm]`,
    );
    return C.times(1e-3, numbers);
  });
}

class PathPanel {
  constructor(svg, lab) {
    this.svg = svg;
    this.lab = lab;
    this.points = [];
    lab.on('turn', () => this.fit());
    svg.addEventListener('pointerdown', (event) => this.begin(event));
    byId('path-points').addEventListener('input', () => this.read());
    byId('path-clear').addEventListener('click', () => this.take([]));
  }

  /** Draw all again, in a plane with room around the foot's present path. */
  fit() {
    const { turn } = this.lab;
    const present = turn.pieces.map((poses) => poses.map((pose) => pose.points[turn.foot]));
    const all = [...present.flat(), ...this.points];
    this.drawing = new Drawing(this.svg, planeAround(all, { margin: PLANE_MARGIN }));
    const path = this.drawing.add('path', 'own-path');
    path.setAttribute('d', present.map((line) => this.drawing.line(line, turn.isTurn)).join(''));
    this.wanted = this.drawing.add('path', 'recorded-path');
    this.show();
  }

  show() {
    this.wanted.setAttribute('d', this.drawing.line(this.points, this.points.length > 0));
  }

  begin(event) {
    if (event.button) return;
    event.preventDefault();
    this.svg.setPointerCapture(event.pointerId);
    this.points = [];
    const move = (moved) => {
      this.points.push(pointerMetres(this.svg, this.drawing, moved));
      this.show();
    };
    const stop = () => {
      this.svg.removeEventListener('pointermove', move);
      for (const name of ['pointerup', 'pointercancel']) this.svg.removeEventListener(name, stop);
      // Less than a pixel is no path.
      const isPath = this.points.some(
        (point) => C.abs(C.sub(point, this.points[0])) * this.drawing.plane.scale > 1,
      );
      this.take(isPath ? evenly(this.points, PATH_POINTS) : []);
    };
    move(event);
    this.svg.addEventListener('pointermove', move);
    for (const name of ['pointerup', 'pointercancel']) this.svg.addEventListener(name, stop);
  }

  /** Take drawn points, and write them. */
  take(points) {
    this.points = points.map((point) => point.map((v) => rounded(v, 1e-4)));
    this.write();
    this.show();
  }

  write() {
    const lines = this.points.map((point) => point.map((v) => plainMillimetres(v)).join(' '));
    const text = lines.join('\n');
    byId('path-points').value = language.now === 'pt' ? text.replaceAll('.', ',') : text;
  }

  /** Take written points. */
  read() {
    this.lab.attempt(() => {
      this.points = pointsOf(byId('path-points').value);
      this.lab.refusal = null;
      this.lab.tell('pose');
    });
    this.fit();
  }

  /** Return the requirements as YAML; `linkage` is the name or the file of the lab's linkage. */
  requirements(linkage) {
    const points = pointsOf(byId('path-points').value);
    refuseUnless(new Set(points.map(String)).size > 2, TEXTS.en.noPath, TEXTS.pt.noPath);
    const isNew = byId('path-structure').value === 'new';
    const may = (id) => byId(id).checked;
    return writeYaml({
      ...(isNew ? { grow: { dyads: 1 } } : { linkage, vary: VARIED }),
      units: { length: 'mm' },
      path: {
        points: points.map((point) => point.map((v) => Number(plainMillimetres(v)))),
        move: may('path-move'),
        turn: may('path-turn'),
        // The size of a new structure is that of its path.
        scale: isNew || may('path-scale'),
      },
    });
  }
}

function plainMillimetres(metres) {
  return String(Number((1000 * metres).toPrecision(12)));
}
