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
    // Why this page drives no more, where only it knows; until somebody drives.
    this.note = '';
    this.wasMine = false;
    this.button.addEventListener('click', () => this.toggle());
  }

  /** Whether this page has it, or waits for others to yield. */
  get isOwner() {
    return Boolean(this.told && this.live.you && this.told.owner === this.live.you.page);
  }

  get isMine() {
    return this.isOwner && !this.told.taking;
  }

  /** Take the state that view_node reports; null where there is nothing to drive. */
  tell(told) {
    this.told = told;
    if (told && told.owner !== null) this.note = '';
    const may = Boolean(told && this.live.you && this.live.you.may);
    this.button.disabled = !may;
    this.button.textContent = this.isOwner ? 'Let go' : 'Take over';
    this.button.setAttribute('aria-pressed', String(this.isOwner));
    const text = this.words(may);
    if (this.state.textContent !== text) this.state.textContent = text;
    this.state.classList.toggle('lost', this.isLoser && Boolean(told.why));
    this.enable(this.isMine);
    if (this.isMine && !this.wasMine) this.state.closest('.card').scrollIntoView({ block: 'nearest' });
    this.wasMine = this.isMine;
  }

  get isLoser() {
    return Boolean(this.told && this.live.you && this.told.loser === this.live.you.page);
  }

  words(may) {
    const { told } = this;
    if (!told) return this.none;
    if (this.refusal) return this.refusal;
    const { topic } = told;
    const rest = told.publishers.filter((name) => !told.yielded.includes(name));
    if (this.isOwner && told.taking) {
      return `Nothing moves yet: waiting until ${listed(rest) || 'all publishers'} ${rest.length > 1 ? 'yield' : 'yields'}.`;
    }
    if (this.isOwner) {
      const yielded = told.yielded.length
        ? ` ${listed(told.yielded)} ${verb(told.yielded, 'has', 'have')} yielded and ${verb(told.yielded, 'resumes', 'resume')} when you let go.`
        : '';
      const idle = rest.length ? ` ${listed(rest)} cannot yield, but ${verb(rest, 'is', 'are')} silent.` : '';
      return `This page drives ${topic}.${yielded}${idle}`;
    }
    if (told.owner !== null) {
      return this.isLoser
        ? `Another page has taken over: it drives ${topic}, this page no longer does.`
        : `Another page drives ${topic}.`;
    }
    const stopped = this.isLoser && told.why ? told.why : this.note;
    if (stopped) return `This page drives nothing: ${stopped}.`;
    if (told.elsewhere) return `${told.elsewhere} drives ${topic}.`;
    const names = told.publishers;
    const who = names.length ? `Published by ${listed(names)}.` : `No node publishes ${topic}.`;
    if (!may) {
      return `${who} This page may only view; the whole address that view_node printed may drive.`;
    }
    const { foreign } = told;
    if (foreign.length) {
      return `${who} ${listed(foreign)} cannot yield: while ${verb(foreign, 'it sends', 'they send')}, this page cannot drive.`;
    }
    return `${who} This page drives nothing until you take over${names.length ? `; then ${listed(names)} ${verb(names, 'yields', 'yield')}` : ''}.`;
  }

  async toggle() {
    if (!this.told) return;
    const wish = { do: this.isOwner ? 'release' : 'take', what: this.told.what };
    this.note = '';
    // From now on, not from when view_node has answered.
    if (!this.isOwner) this.live.connection.drives = true;
    const answer = await this.live.want(wish);
    this.refusal = answer.done ? '' : answer.said;
  }

  release(why) {
    if (!this.isOwner) return;
    this.live.want({ do: 'release', what: this.told.what });
    this.note = why;
  }

  async want(wish) {
    if (!this.isMine) return;
    const answer = await this.live.want({ what: this.told.what, ...wish });
    this.refusal = answer.done ? '' : answer.said;
  }
}

function listed(names) {
  return names.join(', ');
}

function verb(names, one, many) {
  return names.length === 1 ? one : many;
}

class CrankDrive extends Drive {
  constructor(live) {
    super(live, 'crank', 'take', 'crank-state');
    this.none = 'No solver that hears crank angles.';
    this.slider = byId('angle');
    this.speed = byId('speed');
    this.halt = byId('halt');
    this.fold = byId('crank-fold');
    this.isFolded = false;
    this.leg = null;
    this.track = null;
    this.held = 0;
    this.slider.addEventListener('input', () => this.turn());
    this.speed.addEventListener('input', () => this.spin(Number(this.speed.value)));
    this.halt.addEventListener('click', () => this.spin(0));
  }

  /** On a walker the walk comes first: the crank only on request. */
  foldIf(isWalker) {
    if (isWalker === this.isFolded) return;
    this.isFolded = isWalker;
    this.fold.classList.toggle('folds', isWalker);
    this.fold.open = !isWalker;
    byId('crank-consequence').hidden = !isWalker;
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
    this.mark();
  }

  enable(isMine) {
    for (const button of this.buttons) button.disabled = !isMine;
    this.stick.classList.toggle('off', !isMine);
    if (!isMine) this.keys.clear();
  }

  /** Show which buttons and keys are down, and the command that they make. */
  mark() {
    const held = [...this.keys.values()].map(String);
    for (const button of this.buttons) {
      button.classList.toggle('down', held.includes(String(button.dataset.walk.split(',').map(Number))));
    }
    const [forward, turn] = this.command();
    const text = this.isMine ? `Commanded: ${forward.toFixed(2)} m/s, ${turn.toFixed(2)} rad/s` : '';
    if (byId('walk-command').textContent !== text) byId('walk-command').textContent = text;
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

  /** Return the velocities that the keys, buttons and the stick ask for [m/s], [rad/s]. */
  command() {
    let [forward, turn] = [0, 0];
    for (const [u, v] of this.keys.values()) {
      forward += u;
      turn += v;
    }
    const within = (value) => Math.max(-1, Math.min(1, value));
    return [WALK_SPEED * within(forward), WALK_TURN * within(turn)];
  }

  walk() {
    this.mark();
    const [value, turn] = this.command();
    this.want({ do: 'walk', value, turn });
  }
}
