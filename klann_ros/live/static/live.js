'use strict';
/* The page: it shows the frames that it receives. */

// Update period of texts, and of the legs beside the selected one [s].
const READ_PERIOD = 0.1;
// The update period holds for a walker with more legs as well.
const MANY_LEGS = 8;

class Live {
  constructor() {
    this.client = null;
    this.solvers = [];
    this.legs = [];
    this.tracks = [];
    this.version = -1;
    this.shown = '';
    this.tiles = [];
    this.views = [];
    this.ground = new Ground();
    this.truth = new Ground({ hasHeight: true });
    this.cards = new Map();
    this.drawn = [];
    this.read = 0;
    this.crank = new CrankDrive(this);
    this.walk = new WalkDrive(this);
    this.stage = new Stage(this);
    this.lengths = new LengthFields(this, byId('lengths'), byId('lengths-state'));
    document.addEventListener('visibilitychange', () => document.hidden && this.releaseAll('it was hidden'));
    onThemeChange(() => this.history && (this.history.last = 0));
    this.connection = new Connection(
      (frame) => this.draw(frame),
      (isOpen, reason) => this.connected(isOpen, reason),
    );
    setInterval(() => this.showState(), 1000);
  }

  get mayDrive() {
    return Boolean(this.client && this.client.may_drive);
  }

  request(command) {
    return this.connection.request(command);
  }

  releaseAll(reason) {
    for (const drive of [this.crank, this.walk]) drive.release(reason);
  }

  connected(isOpen, reason) {
    this.isOpen = isOpen;
    this.reason = reason;
    if (!isOpen) {
      for (const drive of [this.crank, this.walk]) {
        if (drive.isOwner) drive.note = 'its connection was lost';
      }
      this.client = null;
      this.version = -1;
      this.updateDrives([]);
    }
    this.showState();
  }

  /** Show the connection, and whether the pose is current. */
  showState() {
    const rate = this.drawn.filter((time) => time > performance.now() - 1000).length;
    const hasPose = this.legs.some((_, i) => this.tracks[i].age < OLD);
    const state = !this.isOpen ? 'bad' : hasPose && rate ? 'good' : 'still';
    const notes = this.solvers.map((solver) => solver.note && `${solver.node}: ${solver.note}`).join(' ');
    const titles = { bad: 'No connection', good: 'Live', still: 'Nothing moves' };
    const texts = {
      bad: this.reason || 'Is view_node running? After a restart it has a new address.',
      good: `${rate} frames a second${this.mayDrive ? '' : ', looking only'}`,
      still: this.legs.length ? 'No new poses.' : notes || 'No leg publishes yet.',
    };
    byId('state').className = `verdict ${state}`;
    byId('state-title').textContent = titles[state];
    byId('state-text').textContent = texts[state];
  }

  draw(frame) {
    if (frame.client) this.setClient(frame.client);
    if (frame.legs) this.updateLegs(frame.legs);
    if (frame.legs) this.stage.arrange();
    if (frame.drives || frame.client) this.updateDrives(frame.drives || []);
    if (frame.diagnostics) showDiagnostics(byId('diagnostics'), frame.diagnostics);
    if (frame.topics) showTopics(byId('topics'), frame.topics);
    if (frame.machines) this.updateMachines(frame.machines);
    if (frame.poses) this.move(frame.poses);
    if (frame.client) this.showState();
  }

  setClient(client) {
    this.client = client;
    byId('runs').hidden = !client.runs;
    byId('runs').href = `/runs${location.search}`;
  }

  updateLegs(solvers) {
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
    // Its lengths may be new all the same.
    this.leg = this.legs.find((leg) => leg.key === this.shown);
    if (this.leg) this.lengths.update(this.leg.solver, this.leg);
    this.updateDrives(this.driven || []);
  }

  /** Make the pictures of all legs again. */
  arrange() {
    const holder = byId('legs');
    const drawable = this.legs.filter((leg) => leg.shape);
    holder.hidden = drawable.length < 2;
    this.tiles = [];
    holder.replaceChildren();
    for (const leg of drawable.length > 1 ? drawable : []) {
      const svg = document.createElementNS(SVG, 'svg');
      svg.setAttribute('aria-hidden', 'true');
      const button = make('button', '', svg, make('span', '', ...breakable(leg.title)));
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
    const still = drawable.find((leg) => leg.key === this.shown) || drawable[0];
    this.leg = null;
    if (still) this.choose(still.key);
    else this.showNoLeg();
  }

  /** Show that no leg can be drawn any more; the last one stays, pale. */
  showNoLeg() {
    byId('title').textContent = 'Waiting for a leg';
    byId('subtitle').textContent = 'No node publishes a leg that can be drawn.';
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
    this.lengths.update(leg.solver, leg);
    for (const tile of this.tiles) tile.button.setAttribute('aria-pressed', String(tile.leg.key === key));
    const count = this.legs.length;
    byId('title').textContent = count === 1 ? leg.name || leg.kind : titleOf(this.legs);
    byId('subtitle').textContent = `${leg.kind}, ${leg.solver.does} ${leg.solver.node} on ${leg.solver.topics.join(', ')}`;
    const note = byId('picture-note');
    note.hidden = !leg.solver.note;
    note.textContent = leg.solver.note;
    this.caption(this.trackOf(leg));
    this.updateDrives(this.driven || []);
    this.stage.arrange();
  }

  updateDrives(drives) {
    this.driven = drives;
    const crank = this.leg
      ? drives.find((one) => one.kind === 'crank' && this.leg.solver.cranks.includes(one.topic))
      : null;
    if (this.leg) {
      this.crank.leg = this.leg;
      this.crank.track = this.trackOf(this.leg);
    }
    this.crank.update(crank || null);
    const walk = drives.find((one) => one.kind === 'walk') || null;
    this.crank.foldIf(Boolean(walk) && this.views.length > 0);
    this.walk.update(walk);
    const isOwner = this.crank.isOwner || this.walk.isOwner;
    document.body.classList.toggle('drives', isOwner);
    document.body.classList.toggle('walks', this.views.length > 0);
    if (this.connection) this.connection.drives = isOwner;
  }

  updateMachines(machines) {
    byId('machines-section').hidden = !machines.length;
    const keys = machines.map((machine) => JSON.stringify([machine.node, machine.services, this.mayDrive]));
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
      this.cards.get(keys[i]).update(machine);
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
    // Texts need no faster update, and cost more than a moving leg.
    const isRead = now - this.read >= READ_PERIOD;
    if (isRead) this.read = now;
    if (isRead) for (const { leg, picture } of this.tiles) picture.show(this.trackOf(leg));
    const odom = this.odomOf(poses.odom || {});
    this.ground.move(odom);
    this.truth.move(this.odomOf(poses.truth || {}));
    if (this.stage.isInSpace || isRead || this.legs.length <= MANY_LEGS) this.stage.show();
    if (!this.leg) return;
    const track = this.trackOf(this.leg);
    this.picture.show(track);
    this.history.show(track, now);
    if (!isRead) return;
    this.crank.follow();
    this.caption(track);
    byId('odometry').textContent = this.ground.text;
    byId('walking').textContent = odom ? motionText(odom[3], odom[4]) : '–';
  }

  /** Return the odometry in the namespace of the shown walker; of the only walker, the only one. */
  odomOf(odoms) {
    const [leg] = this.stage.legs;
    const parent = (name) => name.slice(0, name.lastIndexOf('/'));
    const names = Object.keys(odoms);
    const own = leg && names.find((name) => parent(name) === parent(leg.solver.node));
    const walkers = new Set(this.legs.filter(({ mount }) => mount).map(({ solver }) => solver.node));
    return odoms[own || (names.length === 1 && walkers.size <= 1 ? names[0] : '')];
  }

  caption(track) {
    if (!track.x) {
      byId('picture-text').textContent = 'No pose yet.';
      return;
    }
    const at = track.foot.map((value) => fixedText(1000 * value, 1));
    const age = track.age > OLD ? `, ${track.age.toFixed(0)} s old` : '';
    byId('picture-text').textContent =
      `${this.legs.length > 1 ? `${this.leg.title}: ` : ''}Crank ${fixedText(degrees(wrapped(track.x[0])), 1)}°, ${this.leg.point} at ${at[0]}, ${at[1]} mm${age}.`;
  }
}

/** Return the title of an unnamed leg: a player has several, of different topics. */
function titleAmong(solvers, solver) {
  if (solvers.length === 1) return 'Leg';
  const isOne = solvers.filter((other) => other.node === solver.node).length === 1;
  return isOne ? solver.node : solver.topics.join(', ');
}

function titleOf(legs) {
  const isWalker = legs.every((leg) => leg.mount && leg.solver === legs[0].solver);
  return isWalker ? `Walker with ${legs.length} legs` : `${legs.length} legs`;
}

// For the console.
const live = new Live();
