'use strict';
/* The drives of the page: active only after their button was pressed, while the page is visible. */

// Full speed [m/s], [rad/s].
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

/** A drive with its button: a crank or a walker. */
class Drive {
  constructor(live, kind, button, state) {
    this.live = live;
    this.kind = kind;
    this.button = byId(button);
    this.state = byId(state);
    this.report = null;
    this.refusal = '';
    // The reason for the end of this page's drive, if only the page knows it; until the next drive.
    this.note = '';
    this.wasMine = false;
    this.button.addEventListener('click', () => this.toggle());
  }

  /** Whether this page owns the drive, or waits for others to yield. */
  get isOwner() {
    return Boolean(this.report && this.live.client && this.report.owner === this.live.client.page);
  }

  get isMine() {
    return this.isOwner && !this.report.taking;
  }

  /** Show the state that view_node reports; null without anything to drive. */
  update(report) {
    this.report = report;
    if (report && report.owner !== null) this.note = '';
    const mayDrive = Boolean(report && this.live.client && this.live.client.may_drive);
    this.button.disabled = !mayDrive || (!this.isOwner && this.isExcluded);
    this.button.textContent = this.isOwner ? 'Release' : this.yields ? 'Take over' : 'Drive';
    this.button.setAttribute('aria-pressed', String(this.isOwner));
    const text = this.statusText(mayDrive);
    if (this.state.textContent !== text) this.state.textContent = text;
    this.state.classList.toggle('lost', this.hasLost && Boolean(report.reason));
    // A refusal of a command that crossed the loss of the drive is of no interest.
    if (this.wasMine && !this.isMine) this.refusal = '';
    this.enable(this.isMine);
    if (this.isMine && !this.wasMine) this.state.closest('.card').scrollIntoView({ block: 'nearest' });
    this.wasMine = this.isMine;
  }

  /** Whether somebody yields: another page, or a publisher. */
  get yields() {
    const { report } = this;
    return Boolean(report) && (report.owner !== null || report.publishers.length > report.foreign.length);
  }

  /** Whether a publisher that cannot yield, or another driver, leaves this page nothing to drive. */
  get isExcluded() {
    return Boolean(this.report && (this.report.blocking.length || this.report.elsewhere));
  }

  get hasLost() {
    return Boolean(this.report && this.live.client && this.report.previous_owner === this.live.client.page);
  }

  statusText(mayDrive) {
    const { report } = this;
    if (!report) return this.none;
    if (this.refusal) return this.refusal;
    const { topic } = report;
    const rest = report.publishers.filter((name) => !report.yielded.includes(name));
    if (this.isOwner && report.taking) {
      return `Nothing moves yet: waiting until ${listed(rest) || 'all publishers'} ${rest.length > 1 ? 'yield' : 'yields'}.`;
    }
    if (this.isOwner) {
      const yielded = report.yielded.length
        ? ` ${listed(report.yielded)} ${verb(report.yielded, 'has', 'have')} yielded and ${verb(report.yielded, 'resumes', 'resume')} when you release it.`
        : '';
      const idle = rest.length ? ` ${listed(rest)} cannot yield, but ${verb(rest, 'is', 'are')} silent.` : '';
      return `This page drives ${topic}.${yielded}${idle}`;
    }
    if (report.owner !== null) {
      return this.hasLost
        ? `Another page has taken over: it drives ${topic}, this page no longer does.`
        : `Another page drives ${topic}.`;
    }
    const stopped = this.hasLost && report.reason ? inPageUnits(report.reason) : this.note;
    if (stopped) return `Stopped: ${stopped}. This page no longer drives ${topic}.`;
    if (report.elsewhere) return `${report.elsewhere} drives ${topic}.`;
    const names = report.publishers;
    const who = names.length ? `Published by ${listed(names)}.` : `No node publishes ${topic}.`;
    if (!mayDrive) {
      return `${who} This page may only view; the whole address that view_node printed may drive.`;
    }
    const { blocking, foreign } = report;
    if (blocking.length) {
      return `${who} ${listed(blocking)} cannot yield: while ${verb(blocking, 'it sends', 'they send')}, this page cannot drive.`;
    }
    const yielding = names.filter((name) => !foreign.includes(name));
    if (!yielding.length) {
      const idle = foreign.length ? ` ${listed(foreign)} cannot yield, but ${verb(foreign, 'is', 'are')} silent.` : '';
      return `${who}${idle} This page drives nothing until you press Drive.`;
    }
    const others = foreign.length ? ` ${listed(foreign)} cannot yield, and must be silent then.` : '';
    return `${who} This page drives nothing until you take over; then ${listed(yielding)} ${verb(yielding, 'yields', 'yield')}.${others}`;
  }

  async toggle() {
    if (!this.report) return;
    const command = { command: this.isOwner ? 'release' : 'take', target: this.report.target };
    this.note = '';
    // Before view_node has answered.
    if (!this.isOwner) this.live.connection.drives = true;
    const answer = await this.live.request(command);
    this.refusal = answer.done ? '' : inPageUnits(answer.message);
  }

  release(reason) {
    if (!this.isOwner) return;
    this.live.request({ command: 'release', target: this.report.target });
    this.note = reason;
  }

  async request(command) {
    if (!this.isMine) return;
    const answer = await this.live.request({ target: this.report.target, ...command });
    if (!this.isMine) return;
    this.refusal = answer.done ? '' : inPageUnits(answer.message);
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
    this.none = 'No solver subscribes to a crank angle.';
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

  /** Fold the crank card on a walker: the walk has priority. */
  foldIf(isWalker) {
    if (isWalker === this.isFolded) return;
    this.isFolded = isWalker;
    this.fold.classList.toggle('folds', isWalker);
    this.fold.open = !isWalker;
    byId('crank-consequence').hidden = !isWalker;
  }

  enable(isMine) {
    this.slider.disabled = this.speed.disabled = this.halt.disabled = !isMine;
    if (!isMine || !this.wasMine) this.setSpeed(0);
    if (!isMine) this.showCommand('none', 'none');
  }

  setSpeed(value) {
    this.speed.value = value;
    this.showCommand(`${value}°/s`, `${value} degrees a second`);
  }

  showCommand(text, spoken) {
    byId('speed-text').textContent = text;
    this.speed.setAttribute('aria-valuetext', spoken);
  }

  /** Turn to the slider's angle, in the turn where the crank is. */
  turn() {
    if (!this.track || !this.track.x) return;
    this.held = performance.now();
    this.setSpeed(0);
    const now = this.track.x[0];
    const alpha = now + wrapped((Number(this.slider.value) * TURN) / 360 - now);
    const { direction, phase } = this.leg;
    this.showAngle(Number(this.slider.value));
    this.request({ command: 'turn', value: (alpha - phase) / direction });
  }

  /** Turn at a speed [deg/s]. */
  spin(value) {
    this.setSpeed(value);
    this.request({ command: 'spin', value: inSiUnit(value, 'rad/s') * this.leg.direction });
  }

  /** Let the slider follow the leg, unless it is being moved. */
  follow() {
    if (!this.track || !this.track.x) return;
    byId('turning').textContent = turningText(this.track);
    if (performance.now() - this.held < 400) return;
    const angle = degrees(wrapped(this.track.x[0]));
    this.slider.value = angle;
    this.showAngle(angle);
  }

  showAngle(angle) {
    byId('angle-text').textContent = `${fixedText(angle, 1)}°`;
    this.slider.setAttribute('aria-valuetext', `${fixedText(angle, 0)} degrees`);
  }
}

/** Return in words how fast the crank of a track turns, whoever drives it. */
function turningText(track) {
  const speed = track.crankSpeed();
  if (track.age > OLD || !Number.isFinite(speed)) return 'unknown';
  return Math.abs(speed) < 0.05 ? 'at rest' : `${fixedText(speed, 1)}°/s`;
}

/** Return a velocity [m/s], [rad/s] in the page's units. */
function motionText(forward, turn) {
  return `${fixedText(forward, 2)} m/s, ${fixedText(degrees(turn), 0)}°/s`;
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
      this.stick.addEventListener(name, () => this.lift('stick'));
    }
  }

  update(report) {
    byId('walk-card').hidden = !report;
    super.update(report);
    this.mark();
  }

  enable(isMine) {
    for (const button of this.buttons) button.disabled = !isMine;
    this.stick.classList.toggle('off', !isMine);
    if (!isMine) this.keys.clear();
  }

  /** Show the pressed buttons and keys, and their command. */
  mark() {
    const held = [...this.keys.values()].map(String);
    for (const button of this.buttons) {
      button.classList.toggle('down', held.includes(String(button.dataset.walk.split(',').map(Number))));
    }
    const [forward, turn] = this.command();
    const text = this.isMine ? motionText(forward, turn) : 'none';
    if (byId('walk-command').textContent !== text) byId('walk-command').textContent = text;
  }

  key(event, isDown) {
    const direction = KEYS[event.code];
    if (!direction || !this.isMine || event.altKey || event.ctrlKey || event.metaKey) return;
    if (event.target.matches && event.target.matches('input, select')) return;
    event.preventDefault();
    if (event.repeat) return;
    if (isDown) this.press(event.code, direction);
    else this.lift(event.code);
  }

  hold(button) {
    const direction = button.dataset.walk.split(',').map(Number);
    button.addEventListener('pointerdown', (event) => {
      button.setPointerCapture(event.pointerId);
      this.press(button, direction);
    });
    for (const name of ['pointerup', 'pointercancel', 'lostpointercapture']) {
      button.addEventListener(name, () => this.lift(button));
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

  press(key, direction) {
    if (!this.isMine) return;
    this.keys.set(key, direction);
    this.walk();
  }

  lift(key) {
    if (key === 'stick') byId('knob').style.transform = '';
    if (this.keys.delete(key)) this.walk();
  }

  rest() {
    if (!this.keys.size) return;
    this.keys.clear();
    this.walk();
  }

  /** Return the velocities commanded by keys, buttons and stick [m/s], [rad/s]. */
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
    this.request({ command: 'walk', value, turn });
  }
}
