'use strict';
/* The runs that the page shows: one, or two to compare. */

class Run {
  constructor(data) {
    this.path = data.path;
    this.duration = data.duration;
    this.legs = data.legs.map((leg) => new Leg(leg));
    this.walks = data.walks;
    this.topics = data.topics;
    this.marks = data.marks;
  }

  /** Return the leg of a title, or of a single leg that one; null if there is none. */
  leg(title) {
    const single = this.legs.length === 1 ? this.legs[0] : null;
    return this.legs.find((leg) => leg.title === title) || single;
  }
}

function loadRuns() {
  const holder = document.getElementById('data');
  const runs = JSON.parse(holder.textContent).map((data) => new Run(data));
  // The text is the largest part of the page, and not needed twice.
  holder.textContent = '';
  return runs;
}
