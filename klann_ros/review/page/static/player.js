'use strict';
/* The moment that the page shows, and how it moves on. */

class Player {
  constructor(duration) {
    this.duration = duration;
    this.time = 0;
    this.speed = 1;
    this.isPlaying = false;
    this.listeners = [];
  }

  /** Have a function called whenever the moment changes, or begins or ceases to move. */
  listen(listener) {
    this.listeners.push(listener);
  }

  go(time) {
    this.time = Math.min(Math.max(time, 0), this.duration);
    this.tell();
  }

  play() {
    if (this.isPlaying) return;
    if (this.time >= this.duration) this.time = 0;
    this.isPlaying = true;
    this.tell();
    let last = null;
    const frame = (now) => {
      if (!this.isPlaying) return;
      if (last !== null) this.advance(((now - last) / 1000) * this.speed);
      last = now;
      requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
  }

  pause() {
    this.isPlaying = false;
    this.tell();
  }

  toggle() {
    if (this.isPlaying) this.pause();
    else this.play();
  }

  advance(seconds) {
    if (this.time + seconds >= this.duration) this.isPlaying = false;
    this.go(this.time + seconds);
  }

  tell() {
    for (const listener of this.listeners) listener();
  }
}
