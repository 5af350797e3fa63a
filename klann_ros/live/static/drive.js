'use strict';
/* What the page turns: only after its button was pressed, and no longer than it is seen. */

// What full speed is [m/s], [rad/s].
const WALK_SPEED = 0.25;
const WALK_TURN = 0.8;
const KEYS = {
  ArrowUp: [1, 0], KeyW: [1, 0],
  ArrowDown: [-1, 0], KeyS: [-1, 0],
  ArrowLeft: [0, 1], KeyA: [0, 1],
  ArrowRight: [0, -1], KeyD: [0, -1],
};

function byId(id) {
  return document.getElementById(id);
}

/** What is taken over by a button: a crank or a walker. */
class Drive {
  constructor(live, kind, button, state) {
    this.live = live;
    this.kind = kind;
    this.button = byId(button);
    this.state = byId(state);
    this.told = null;
    this.refusal = '';
    this.button.addEventListener('click', () => this.toggle());
  }

  get isMine() {
    return Boolean(this.told && this.live.you && this.told.owner === this.live.you.page);
  }

  /** Take what view_node tells of it; null where there is none. */
  tell(told) {
    this.told = told;
    const may = Boolean(told && this.live.you && this.live.you.may);
    this.button.disabled = !may;
    this.button.textContent = this.isMine ? 'Let go' : 'Take over';
    this.button.setAttribute('aria-pressed', String(this.isMine));
    const text = this.words(may);
    if (this.state.textContent !== text) this.state.textContent = text;
    this.enable(this.isMine);
  }

  words(may) {
    const { told } = this;
    if (!told) return this.none;
    if (this.refusal) return this.refusal;
    const names = told.others.join(', ');
    if (this.isMine) {
      const clash = names && ` ${names} drives it as well: stop that, or both pull at it.`;
      return `This page drives ${told.topic}.${clash}`;
    }
    if (told.owner !== null) return `Another page drives ${told.topic}.`;
    if (told.why) return `This page drives nothing: ${told.why}.`;
    const who = names ? `Driven by ${names}.` : `Nobody drives ${told.topic}.`;
    return may
      ? `${who} This page drives nothing until you take over.`
      : `${who} This page may only look; the whole address that view_node printed may drive.`;
  }

  async toggle() {
    if (!this.told) return;
    const wish = { do: this.isMine ? 'release' : 'take', what: this.told.what };
    const answer = await this.live.want(wish);
    this.refusal = answer.done ? '' : answer.said;
  }

  release() {
    if (this.isMine) this.live.want({ do: 'release', what: this.told.what });
  }

  async want(wish) {
    if (!this.isMine) return;
    const answer = await this.live.want({ what: this.told.what, ...wish });
    this.refusal = answer.done ? '' : answer.said;
  }
}

class CrankDrive extends Drive {
  constructor(live) {
    super(live, 'crank', 'take', 'crank-state');
    this.none = 'No solver that hears crank angles.';
    this.slider = byId('angle');
    this.speed = byId('speed');
    this.halt = byId('halt');
    this.leg = null;
    this.track = null;
    this.held = 0;
    this.slider.addEventListener('input', () => this.turn());
    this.speed.addEventListener('input', () => this.spin(Number(this.speed.value)));
    this.halt.addEventListener('click', () => this.spin(0));
  }

  enable(isMine) {
    this.slider.disabled = this.speed.disabled = this.halt.disabled = !isMine;
    if (!isMine) this.setSpeed(0);
  }

  setSpeed(value) {
    this.speed.value = value;
    byId('speed-text').textContent = `${value.toFixed(1)} rad/s`;
  }

  /** Turn to the slider's angle, in the turn where the crank is. */
  turn() {
    if (!this.track || !this.track.x) return;
    this.held = performance.now();
    this.setSpeed(0);
    const now = this.track.x[0];
    const alpha = now + wrapped((Number(this.slider.value) * TURN) / 360 - now);
    const { direction, phase } = this.leg;
    this.say(Number(this.slider.value));
    this.want({ do: 'turn', value: (alpha - phase) / direction });
  }

  spin(value) {
    this.setSpeed(value);
    this.want({ do: 'spin', value: value * this.leg.direction });
  }

  /** Let the slider follow the leg, unless it is being moved. */
  follow() {
    if (!this.track || !this.track.x || performance.now() - this.held < 400) return;
    const angle = degrees(wrapped(this.track.x[0]));
    this.slider.value = angle;
    this.say(angle);
  }

  say(angle) {
    const text = `${angle.toFixed(1)}°`;
    byId('angle-text').textContent = text;
    this.slider.setAttribute('aria-valuetext', `${angle.toFixed(0)} degrees`);
  }
}

class WalkDrive extends Drive {
  constructor(live) {
    super(live, 'walk', 'walk-take', 'walk-state');
    this.none = '';
    this.keys = new Map();
    this.stick = byId('stick');
    this.buttons = [...document.querySelectorAll('[data-walk]')];
    addEventListener('keydown', (event) => this.key(event, true));
    addEventListener('keyup', (event) => this.key(event, false));
    addEventListener('blur', () => this.rest());
    for (const button of this.buttons) this.hold(button);
    this.stick.addEventListener('pointerdown', (event) => this.grab(event));
    this.stick.addEventListener('pointermove', (event) => this.pull(event));
    for (const name of ['pointerup', 'pointercancel']) {
      this.stick.addEventListener(name, () => this.leave('stick'));
    }
  }

  tell(told) {
    byId('walk-card').hidden = !told;
    super.tell(told);
  }

  enable(isMine) {
    for (const button of this.buttons) button.disabled = !isMine;
    this.stick.classList.toggle('off', !isMine);
    if (!isMine) this.keys.clear();
  }

  key(event, isDown) {
    const wish = KEYS[event.code];
    if (!wish || !this.isMine || event.altKey || event.ctrlKey || event.metaKey) return;
    if (event.target.matches && event.target.matches('input, select')) return;
    event.preventDefault();
    if (event.repeat) return;
    if (isDown) this.press(event.code, wish);
    else this.leave(event.code);
  }

  hold(button) {
    const wish = button.dataset.walk.split(',').map(Number);
    button.addEventListener('pointerdown', (event) => {
      button.setPointerCapture(event.pointerId);
      this.press(button, wish);
    });
    for (const name of ['pointerup', 'pointercancel', 'lostpointercapture']) {
      button.addEventListener(name, () => this.leave(button));
    }
  }

  grab(event) {
    if (!this.isMine) return;
    this.stick.setPointerCapture(event.pointerId);
    this.pull(event);
  }

  pull(event) {
    if (!this.isMine || !this.stick.hasPointerCapture(event.pointerId)) return;
    const box = this.stick.getBoundingClientRect();
    let x = (2 * (event.clientX - box.left)) / box.width - 1;
    let y = (2 * (event.clientY - box.top)) / box.height - 1;
    const size = Math.max(1, Math.hypot(x, y));
    [x, y] = [x / size, y / size];
    byId('knob').style.transform = `translate(${x * 42}px, ${y * 42}px)`;
    this.press('stick', [-y, -x]);
  }

  press(key, wish) {
    if (!this.isMine) return;
    this.keys.set(key, wish);
    this.walk();
  }

  leave(key) {
    if (key === 'stick') byId('knob').style.transform = '';
    if (this.keys.delete(key)) this.walk();
  }

  rest() {
    if (!this.keys.size) return;
    this.keys.clear();
    this.walk();
  }

  walk() {
    let [forward, turn] = [0, 0];
    for (const [u, v] of this.keys.values()) {
      forward += u;
      turn += v;
    }
    const within = (value) => Math.max(-1, Math.min(1, value));
    this.want({ do: 'walk', value: WALK_SPEED * within(forward), turn: WALK_TURN * within(turn) });
  }
}
