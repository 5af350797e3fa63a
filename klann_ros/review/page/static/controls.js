'use strict';
/* What turns and stops the leg: buttons, the slider, and keys. */

// Poses of a step with the shift key.
const STRIDE = 10;

class Controls {
  /** `leg` returns the leg whose poses the keys step through. */
  constructor(player, leg) {
    this.player = player;
    this.leg = leg;
    this.play = document.getElementById('play');
    this.slider = document.getElementById('time');
    this.slider.max = player.duration;
    this.play.addEventListener('click', () => player.toggle());
    this.slider.addEventListener('input', () => player.go(Number(this.slider.value)));
    document.getElementById('speed').addEventListener('change', (event) => {
      player.speed = Number(event.target.value);
    });
    document.addEventListener('keydown', (event) => this.key(event));
    player.listen(() => this.update());
  }

  /** Put marks beside the slider at the times of findings. */
  mark(times) {
    const marks = document.getElementById('marks');
    for (const time of times) {
      const mark = document.createElement('i');
      mark.style.left = `${this.player.duration ? (100 * time) / this.player.duration : 0}%`;
      marks.append(mark);
    }
  }

  update() {
    const { player } = this;
    this.play.textContent = player.isPlaying ? 'Pause' : 'Play';
    this.play.classList.toggle('playing', player.isPlaying);
    this.slider.value = player.time;
    const leg = this.leg();
    const row = leg ? leg.nearest(player.time) : -1;
    this.slider.setAttribute('aria-valuetext', `${player.time.toFixed(3)} s`);
    document.getElementById('at-time').textContent = `${player.time.toFixed(3)} s`;
    document.getElementById('at-crank').textContent = crankText(leg, row);
    document.getElementById('at-foot').textContent = footText(leg, row);
  }

  key(event) {
    if (event.altKey || event.ctrlKey || event.metaKey) return;
    const isSlider = event.target === this.slider;
    // Those have keys of their own.
    if (!isSlider && event.target.closest('select, input, textarea, .scrolls')) return;
    if (event.key === ' ' && event.target.closest('button, summary')) return;
    const act = this.actions(event.shiftKey ? STRIDE : 1)[event.key];
    if (!act) return;
    event.preventDefault();
    act();
  }

  actions(poses) {
    const { player } = this;
    return {
      ' ': () => player.toggle(),
      ArrowRight: () => this.step(poses),
      ArrowLeft: () => this.step(-poses),
      ...(document.activeElement === this.slider
        ? { ArrowUp: () => this.step(poses), ArrowDown: () => this.step(-poses) }
        : {}),
      Home: () => player.go(0),
      End: () => player.go(player.duration),
    };
  }

  /** Step by a number of recorded poses. */
  step(poses) {
    const leg = this.leg();
    if (!leg || !leg.count) return;
    this.player.isPlaying = false;
    const row = Math.min(Math.max(leg.nearest(this.player.time) + poses, 0), leg.count - 1);
    this.player.go(leg.times[row]);
  }
}

function crankText(leg, row) {
  const angle = leg && row >= 0 ? leg.crankAngle(row) / TURN : NaN;
  if (!Number.isFinite(angle)) return '–';
  const turn = Math.floor(angle);
  return `${fixedText(360 * (angle - turn), 2)}° turn ${turn}`;
}

function footText(leg, row) {
  const at = leg && row >= 0 ? leg.footAt(row) : null;
  return at ? positionText(at) : '–';
}
