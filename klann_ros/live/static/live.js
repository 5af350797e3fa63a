'use strict';
/* The page: frames come in, and what they say is shown. */

// Texts, and legs that are shown beside the chosen one, follow so often [s].
const READ_PERIOD = 0.1;
// A walker with more of them is seen so often as well.
const MANY_LEGS = 8;

class Live {
  constructor() {
    this.you = null;
    this.solvers = [];
    this.legs = [];
    this.tracks = [];
    this.version = -1;
    this.shown = '';
    this.tiles = [];
    this.views = [];
    this.ground = new Ground();
    this.cards = new Map();
    this.drawn = [];
    this.read = 0;
    this.crank = new CrankDrive(this);
    this.walk = new WalkDrive(this);
    this.lengths = new LengthFields(this, byId('lengths'), byId('lengths-state'));
    document.addEventListener('visibilitychange', () => document.hidden && this.letGo('it was hidden'));
    onThemeChange(() => this.history && (this.history.last = 0));
    this.connection = new Connection(
      (frame) => this.draw(frame),
      (isThere, why) => this.connected(isThere, why),
    );
    setInterval(() => this.say(), 1000);
  }

  get may() {
    return Boolean(this.you && this.you.may);
  }

  want(wish) {
    return this.connection.want(wish);
  }

  letGo(why) {
    for (const drive of [this.crank, this.walk]) drive.release(why);
  }

  connected(isThere, why) {
    this.isThere = isThere;
    this.why = why;
    if (!isThere) {
      for (const drive of [this.crank, this.walk]) {
        if (drive.isOwner) drive.note = 'its connection was lost';
      }
      this.you = null;
      this.version = -1;
      this.tellDrives([]);
    }
    this.say();
  }

  /** Say whether what is shown is of now. */
  say() {
    const rate = this.drawn.filter((time) => time > performance.now() - 1000).length;
    const hasPose = this.legs.some((_, i) => this.tracks[i].age < OLD);
    const state = !this.isThere ? 'bad' : hasPose && rate ? 'good' : 'still';
    const notes = this.solvers.map((solver) => solver.note && `${solver.node}: ${solver.note}`).join(' ');
    const titles = { bad: 'No connection', good: 'Live', still: 'Nothing moves' };
    const texts = {
      bad: this.why || 'Is view_node running? Started anew, it has a new address.',
      good: `${rate} frames a second${this.may ? '' : ', looking only'}`,
      still: this.legs.length ? 'No new poses.' : notes || 'No leg publishes yet.',
    };
    byId('state').className = `verdict ${state}`;
    byId('state-title').textContent = titles[state];
    byId('state-text').textContent = texts[state];
  }

  draw(frame) {
    if (frame.you) this.greet(frame.you);
    if (frame.legs) this.tellLegs(frame.legs);
    if (frame.drives || frame.you) this.tellDrives(frame.drives || []);
    if (frame.diagnostics) showDiagnostics(byId('diagnostics'), frame.diagnostics);
    if (frame.topics) showTopics(byId('topics'), frame.topics);
    if (frame.machines) this.tellMachines(frame.machines);
    if (frame.poses) this.move(frame.poses);
    if (frame.you) this.say();
  }

  greet(you) {
    this.you = you;
    byId('runs').hidden = !you.runs;
    byId('runs').href = `/runs${location.search}`;
  }

  tellLegs(solvers) {
    this.solvers = solvers;
    const before = this.legs;
    const tracks = this.tracks;
    this.legs = [];
    for (const solver of solvers) {
      solver.numbers.forEach((number, i) => {
        const leg = { ...solver.legs[i], solver };
        leg.key = `${solver.node} ${solver.topics} ${leg.name}`;
        leg.text = JSON.stringify([leg.shape, leg.mount]);
        leg.title = leg.name || titleAmong(solvers, solver);
        this.legs[number] = leg;
      });
    }
    this.tracks = this.legs.map((leg) => {
      const i = before.findIndex((other) => other.key === leg.key && other.text === leg.text);
      if (i < 0) return new Track(leg);
      tracks[i].leg = leg;
      return tracks[i];
    });
    const look = (legs) => JSON.stringify(legs.map((leg) => [leg.key, leg.text]));
    if (look(before) !== look(this.legs)) this.arrange();
    // What its solver tells of it may be new all the same.
    this.leg = this.legs.find((leg) => leg.key === this.shown);
    if (this.leg) this.lengths.tell(this.leg.solver, this.leg);
    this.tellDrives(this.driven || []);
  }

  /** Draw all that is drawn of legs anew. */
  arrange() {
    const holder = byId('legs');
    const drawable = this.legs.filter((leg) => leg.shape);
    holder.hidden = drawable.length < 2;
    this.tiles = [];
    holder.replaceChildren();
    for (const leg of drawable.length > 1 ? drawable : []) {
      const svg = document.createElementNS(SVG, 'svg');
      svg.setAttribute('aria-hidden', 'true');
      const button = make('button', '', svg, make('span', '', leg.title));
      button.type = 'button';
      button.addEventListener('click', () => this.choose(leg.key));
      holder.append(button);
      this.tiles.push({ leg, button, picture: new LegPicture(svg, leg, { small: true }) });
    }
    const mounts = drawable.filter((leg) => leg.mount);
    for (const card of document.querySelectorAll('[data-of=walker]')) card.hidden = mounts.length < 2;
    this.views = mounts.length < 2
      ? []
      : Object.keys(VIEWS).map((view) => new WalkerPicture(byId(view), view, mounts, this.ground));
    if (this.views.length) byId('grid').textContent = String(Number(this.views[0].grid.toPrecision(1)));
    const still = drawable.find((leg) => leg.key === this.shown) || drawable[0];
    this.leg = null;
    if (still) this.choose(still.key);
    else this.miss();
  }

  /** Say that there is no leg to be drawn any more; the last one stays, and is pale. */
  miss() {
    byId('title').textContent = 'Waiting for a leg';
    byId('subtitle').textContent = 'Nobody publishes a leg that can be drawn.';
    byId('picture').classList.add('old');
    byId('lengths-section').hidden = true;
  }

  choose(key) {
    this.shown = key;
    this.leg = this.legs.find((leg) => leg.key === key);
    const { leg } = this;
    this.picture = new LegPicture(byId('picture'), leg);
    this.picture.show(this.trackOf(leg));
    this.history = new History(byId('charts'), leg);
    this.lengths.tell(leg.solver, leg);
    for (const tile of this.tiles) tile.button.setAttribute('aria-pressed', String(tile.leg.key === key));
    const count = this.legs.length;
    byId('title').textContent = count === 1 ? leg.name || leg.kind : titleOf(this.legs);
    byId('subtitle').textContent = `${leg.kind}, ${leg.solver.does} ${leg.solver.node} on ${leg.solver.topics.join(', ')}`;
    const note = byId('picture-note');
    note.hidden = !leg.solver.note;
    note.textContent = leg.solver.note;
    this.caption(this.trackOf(leg));
    this.tellDrives(this.driven || []);
  }

  tellDrives(drives) {
    this.driven = drives;
    const crank = this.leg
      ? drives.find((one) => one.kind === 'crank' && this.leg.solver.cranks.includes(one.topic))
      : null;
    if (this.leg) {
      this.crank.leg = this.leg;
      this.crank.track = this.trackOf(this.leg);
    }
    this.crank.tell(crank || null);
    const walk = drives.find((one) => one.kind === 'walk') || null;
    this.crank.foldIf(Boolean(walk) && this.views.length > 0);
    this.walk.tell(walk);
    const isOwner = this.crank.isOwner || this.walk.isOwner;
    document.body.classList.toggle('drives', isOwner);
    document.body.classList.toggle('walks', this.views.length > 0);
    if (this.connection) this.connection.drives = isOwner;
  }

  tellMachines(machines) {
    byId('machines-section').hidden = !machines.length;
    const keys = machines.map((machine) => JSON.stringify([machine.node, machine.services, this.may]));
    for (const key of this.cards.keys()) {
      if (keys.includes(key)) continue;
      this.cards.get(key).card.remove();
      this.cards.delete(key);
    }
    machines.forEach((machine, i) => {
      if (!this.cards.has(keys[i])) {
        this.cards.set(keys[i], new MachineCard(this, machine));
        byId('machines').append(this.cards.get(keys[i]).card);
      }
      this.cards.get(keys[i]).tell(machine);
    });
  }

  trackOf(leg) {
    return this.tracks[this.legs.findIndex((other) => other.key === leg.key)];
  }

  move(poses) {
    const now = performance.now() / 1000;
    this.drawn.push(now * 1000);
    if (this.drawn.length > 300) this.drawn.splice(0, 150);
    for (const [number, pose] of Object.entries(poses.legs || {})) {
      const track = this.tracks[number];
      if (track && track.leg.shape && pose.length - 2 === track.leg.joints.length) track.add(now, pose);
    }
    // Nobody reads faster; and a text that changes costs more than a leg that moves.
    const isRead = now - this.read >= READ_PERIOD;
    if (isRead) this.read = now;
    if (isRead) for (const { leg, picture } of this.tiles) picture.show(this.trackOf(leg));
    const odom = this.odomOf(poses.odom || {});
    this.ground.move(odom);
    if (isRead || this.legs.length <= MANY_LEGS) {
      for (const picture of this.views) picture.show((leg) => this.trackOf(leg));
    }
    if (!this.leg) return;
    const track = this.trackOf(this.leg);
    this.picture.show(track);
    this.history.show(track, now);
    if (!isRead) return;
    this.crank.follow();
    this.caption(track);
    byId('odometry').textContent = this.ground.text;
  }

  /** Return the odometry in the walker's namespace, or the only one there is. */
  odomOf(odoms) {
    const [leg] = this.views.length ? this.views[0].legs : [];
    const parent = (name) => name.slice(0, name.lastIndexOf('/'));
    const names = Object.keys(odoms);
    const own = leg && names.find((name) => parent(name) === parent(leg.solver.node));
    return odoms[own || (names.length === 1 ? names[0] : '')];
  }

  caption(track) {
    if (!track.x) {
      byId('picture-text').textContent = 'No pose yet.';
      return;
    }
    const foot = track.foot.map((value) => (1000 * value).toFixed(1));
    const age = track.age > OLD ? `, ${track.age.toFixed(0)} s old` : '';
    byId('picture-text').textContent =
      `${this.legs.length > 1 ? `${this.leg.title}: ` : ''}Crank ${degrees(wrapped(track.x[0])).toFixed(1)}°, foot at ${foot[0]}, ${foot[1]} mm${age}.`;
  }
}

/** Return what the unnamed leg of a solver is called: a player has several of different topics. */
function titleAmong(solvers, solver) {
  if (solvers.length === 1) return 'Leg';
  const isOne = solvers.filter((other) => other.node === solver.node).length === 1;
  return isOne ? solver.node : solver.topics.join(', ');
}

function titleOf(legs) {
  const isWalker = legs.every((leg) => leg.mount && leg.solver === legs[0].solver);
  return isWalker ? `Walker with ${legs.length} legs` : `${legs.length} legs`;
}

// One name for whoever opens the console.
const live = new Live();
