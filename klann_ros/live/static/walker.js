'use strict';
/* All legs of a walker in base_link, from the side and from above. */

class WalkerPicture {
  constructor(svg, view, legs) {
    this.svg = svg;
    this.view = VIEWS[view];
    // From the side, those of the left are behind the others.
    this.legs = [...legs].sort((a, b) => b.mount.xyz[1] - a.mount.xyz[1]);
    const middle = legs.reduce((sum, leg) => sum + leg.mount.xyz[1], 0) / legs.length;
    const isFar = (leg) => view === 'side' && leg.mount.xyz[1] > middle + 1e-9;
    const corners = legs.flatMap((leg) => {
      const [left, bottom, right, top] = leg.shape.box || [0, 0, 0, 0];
      const box = [left, right].flatMap((x) => [bottom, top].map((y) => [x, y]));
      return mounted(box, leg.mount).map(this.view);
    });
    this.drawing = new Drawing(svg, planeAround(corners, { width: 640, margin: 30 }));
    this.drawBody();
    this.trails = this.legs.map(() => this.drawing.add('path', 'trail thin'));
    this.bodies = this.legs.map((leg) => {
      const className = isFar(leg) ? 'leg far' : 'leg';
      return new DrawnLeg(this.drawing, leg.shape, { className, hasLetters: false });
    });
  }

  /** A line through all mounts stands for the body. */
  drawBody() {
    const places = this.legs.map((leg) => this.view(leg.mount.xyz));
    const x = places.map((at) => at[0]);
    const y = places.map((at) => at[1]);
    const [left, top] = this.drawing.at([Math.min(...x), Math.max(...y)]);
    const [right, bottom] = this.drawing.at([Math.max(...x), Math.min(...y)]);
    const body = this.drawing.add('rect', 'body');
    body.setAttribute('x', left - 12);
    body.setAttribute('y', top - 12);
    body.setAttribute('width', right - left + 24);
    body.setAttribute('height', bottom - top + 24);
    body.setAttribute('rx', 12);
  }

  /** Show the legs; `trackOf` returns the track of one. */
  show(trackOf) {
    this.bodies.forEach((body, i) => {
      const track = trackOf(this.legs[i]);
      const { points } = track;
      const place = (some) => mounted(some, this.legs[i].mount).map(this.view);
      body.show(points && place(points));
      const trail = track.trail(TRAIL);
      this.trails[i].setAttribute('d', this.drawing.line(trail.length ? place(trail) : []));
    });
  }
}
