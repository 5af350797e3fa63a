'use strict';
/* The time that the page shows, and its playback. */

class Player {
  constructor(duration) {
    this.duration = duration;
    this.time = 0;
    this.speed = 1;
    this.isPlaying = false;
    this.listeners = [];
  }

  /** Call a function when the time changes, or playback starts or stops. */
  listen(listener) {
    this.listeners.push(listener);
  }

  go(time) {
    this.time = Math.min(Math.max(time, 0), this.duration);
    this.notify();
  }

  play() {
    if (this.isPlaying) return;
    if (this.time >= this.duration) this.time = 0;
    this.isPlaying = true;
    this.notify();
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
    this.notify();
  }

  toggle() {
    if (this.isPlaying) this.pause();
    else this.play();
  }

  advance(seconds) {
    if (this.time + seconds >= this.duration) this.isPlaying = false;
    this.go(this.time + seconds);
  }

  notify() {
    for (const listener of this.listeners) listener();
  }
}
