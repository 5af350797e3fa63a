'use strict';
/* A leg in its own plane: its bars, the path of its foot, and its trail. */

// Length of the trail [s].
const TRAIL = 1.2;
// Older poses are shown pale [s].
const OLD = 1.5;

class LegPicture {
  constructor(svg, leg, { small = false } = {}) {
    const { shape } = leg;
    this.svg = svg;
    this.leg = leg;
    const box = shape.box || [-1, -1, 1, 1];
    this.drawing = new Drawing(svg, planeAround([box.slice(0, 2), box.slice(2)]));
    const path = this.drawing.add('path', 'own-path');
    path.setAttribute('d', this.drawing.line(shape.path));
    this.trail = this.drawing.add('path', 'trail');
    this.bodies = new DrawnLeg(this.drawing, shape, { hasLetters: !small });
    this.bodies.show(null);
    delete svg.dataset.x;
  }

  show(track) {
    const { points } = track;
    this.svg.classList.toggle('old', track.age > OLD);
    this.bodies.show(points);
    this.trail.setAttribute('d', this.drawing.line(track.trail(TRAIL)));
    // For tests.
    if (track.x) this.svg.dataset.x = track.x.join(' ');
  }
}
