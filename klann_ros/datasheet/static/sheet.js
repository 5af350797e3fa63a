'use strict';
/* The legs of the sheet in motion: a slider and a button for each, and a mark in its charts. */

// Duration of an animated turn, at any speed of the sheet [ms].
const TURN_TIME = 4000;
// Where a leg stands when the page is opened, as a part of its turn.
const OPENED_AT = 1 / 6;

class LegView {
  constructor(figure, data) {
    this.data = data;
    this.count = data.angles.length;
    // A crank that does not turn fully has no turns.
    this.duration = TURN_TIME * Math.max(1, data.turns);
    this.part = OPENED_AT;
    this.way = data.isClockwise ? -1 : 1;
    this.isPlaying = false;
    this.button = figure.querySelector('.play');
    this.slider = figure.querySelector('.angle');
    this.output = figure.querySelector('.at');
    this.cursors = [...figure.closest('section').querySelectorAll('.cursor')];
    figure.querySelector('.controls').hidden = !this.count;
    if (!this.count) return;
    this.draw(figure.querySelector('.drawing'));
    this.button.addEventListener('click', () => this.toggle());
    this.slider.addEventListener('input', () => {
      this.isPlaying = false;
      this.go(Number(this.slider.value));
    });
    this.go(this.part);
  }

  draw(svg) {
    const { points, stands, foot, turns, shape } = this.data;
    this.drawing = new Drawing(svg, planeAround(points.flat()));
    const feet = points.map((pose) => pose[foot]);
    this.drawing.add('path', 'own-path').setAttribute('d', this.drawing.line(feet, turns > 0));
    const last = turns ? [[...feet, feet[0]], [...stands, stands[0]]] : [feet, stands];
    const onGround = last[0].map((at, i) => (last[1][i] ? at : null));
    this.drawing.add('path', 'trail').setAttribute('d', this.drawing.line(onGround));
    this.leg = new DrawnLeg(this.drawing, shape);
  }

  /** Show the pose at a part of the poses, 0 to 1. */
  go(part) {
    this.part = part;
    const row = Math.min(Math.floor(part * this.count), this.count - 1);
    const angle = this.data.angles[row];
    this.leg.show(this.data.points[row]);
    this.slider.value = part;
    this.slider.setAttribute('aria-valuetext', `${fixedText(angle, 0)} degrees`);
    this.output.textContent = `${fixedText(angle, 1)}°`;
    this.button.textContent = this.isPlaying ? 'Pause' : 'Play';
    for (const cursor of this.cursors) moveCursor(cursor, angle);
  }

  toggle() {
    this.isPlaying = !this.isPlaying;
    this.go(this.part);
    let last = null;
    const frame = (now) => {
      if (!this.isPlaying) return;
      if (last !== null) this.advance((this.way * (now - last)) / this.duration);
      last = now;
      requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
  }

  /** Advance; a crank that does not turn fully goes back and forth. */
  advance(step) {
    const part = this.part + step;
    if (part >= 0 && part < 1) this.go(part);
    else if (this.data.turns) this.go(part - Math.floor(part));
    else this.way = part < 0 ? 1 : -1;
  }
}

function moveCursor(cursor, angle) {
  const { from, to, width } = cursor.dataset;
  const part = (angle - from) / (to - from || 1);
  cursor.setAttribute('transform', `translate(${(part * width).toFixed(1)} 0)`);
}

const sheetData = JSON.parse(document.getElementById('data').textContent);
const views = [...document.querySelectorAll('.leg-view')].map(
  (figure) => new LegView(figure, sheetData[Number(figure.dataset.leg)]),
);
