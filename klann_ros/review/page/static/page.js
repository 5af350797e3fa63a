'use strict';
/* The page: its runs, the leg that is chosen, and everything that shows the moment. */

class Page {
  constructor(runs) {
    this.runs = runs;
    this.duration = Math.max(...runs.map((run) => run.duration));
    this.player = new Player(this.duration);
    this.title = runs[0].legs.length ? runs[0].legs[0].title : '';
    this.isOverCrank = false;
    this.controls = new Controls(this.player, () => this.legs[0]);
    this.controls.mark(runs.flatMap((run) => run.marks));
    this.timing = new TimingCharts(document.getElementById('timing'), runs);
    const showWay = showWalks(runs);
    this.player.listen(() => showWay(this.player.time));
    this.player.listen(() => this.show());
    this.listen();
    this.showLegs();
    this.showTopics();
    this.choose(this.title);
  }

  /** The chosen leg in each run that has it. */
  get legs() {
    return this.runs.map((run) => run.leg(this.title)).filter(Boolean);
  }

  choose(title) {
    this.title = title;
    const [leg, ghost] = this.legs;
    document.getElementById('motion').hidden = !leg;
    document.getElementById('curves').hidden = !leg;
    for (const button of document.querySelectorAll('#legs button')) {
      button.setAttribute('aria-pressed', String(button.dataset.leg === title));
    }
    if (leg) {
      this.picture = new Picture(document.getElementById('picture'), leg, ghost || null);
      if (this.path) this.path.remove();
      this.path = new PathChart(document.getElementById('foot-path'), this.legs, (time) =>
        this.player.go(time),
      );
      this.describe(leg, ghost);
      this.drawCharts();
    }
    this.player.notify();
  }

  describe(leg, ghost) {
    const name = leg.title ? `The leg ${leg.title}` : 'The leg';
    const path = leg.path ? '; dashed: its path by the geometry' : '';
    document.getElementById('picture-text').textContent =
      `${name} at the chosen time. Cross: the recorded foot; thick: its trail${path}.`;
    const what = leg.hasPoses ? 'poses' : 'feet';
    const sampling =
      leg.count < leg.of
        ? `The page holds ${leg.count} of the ${leg.of} recorded ${what}: evenly spaced ones, and the extremes of each part.`
        : `The page holds each of the ${leg.of} recorded ${what}.`;
    document.getElementById('sampling').textContent = sampling;
    this.note = document.getElementById('picture-note');
    this.ghostText = document.getElementById('ghost-text');
    this.ghostText.hidden = !ghost;
  }

  drawCharts() {
    if (this.charts) this.charts.remove();
    const [holder, details] = ['charts', 'accuracy'].map((id) => document.getElementById(id));
    this.charts = new LegCharts(holder, details, this.legs, {
      isOverCrank: this.isOverCrank,
      onPick: (time) => this.player.go(time),
      whole: [0, this.duration],
    });
    document.getElementById('curves').hidden = !this.charts.charts.length;
    for (const [id, isPressed] of [
      ['over-time', !this.isOverCrank],
      ['over-crank', this.isOverCrank],
    ]) {
      document.getElementById(id).setAttribute('aria-pressed', String(isPressed));
    }
  }

  /** Show the time everywhere. */
  show() {
    const [leg, ghost] = this.legs;
    if (!leg || !this.picture) return;
    const row = leg.nearest(this.player.time);
    const why = leg.hiddenBecause(row);
    this.note.hidden = !why;
    this.note.textContent = `Not drawn: ${why}.`;
    this.picture.show(row, ghost ? this.ghostRow(leg, row, ghost) : -1);
    this.path.mark(row);
    this.charts.mark(this.player.time);
    for (const small of this.small || []) small.show(small.leg.nearest(this.player.time), -1);
    if (ghost) {
      const how = this.isOverCrank ? 'crank angle' : 'time since its start';
      this.ghostText.textContent = `Dashed: the leg of run B at the same ${how}.`;
    }
  }

  /** Return the other run's row to compare with: as the charts do, by time or by crank angle. */
  ghostRow(leg, row, ghost) {
    return this.isOverCrank && ghost.hasPoses && leg.hasPoses
      ? ghost.nearestAtCrank(leg.angles[0][row])
      : ghost.nearest(this.player.time);
  }

  /** Show all legs of a walker side by side; each is a button that chooses it. */
  showLegs() {
    const legs = this.runs[0].legs;
    if (legs.length < 2) return;
    const holder = document.getElementById('legs');
    holder.hidden = false;
    this.small = legs.map((leg) => {
      const svg = document.createElementNS(SVG, 'svg');
      svg.setAttribute('aria-hidden', 'true');
      const button = make('button', '', svg, leg.title || 'unnamed');
      button.type = 'button';
      button.dataset.leg = leg.title;
      button.addEventListener('click', () => this.choose(leg.title));
      holder.append(button);
      return new Picture(svg, leg, null, { small: true });
    });
  }

  showTopics() {
    const select = document.getElementById('topic');
    const names = new Set(this.runs.flatMap((run) => run.topics.map((topic) => topic.name)));
    for (const name of names) select.append(new Option(name, name));
    select.addEventListener('change', () => this.timing.show(select.value));
    if (!names.size) return;
    select.value = this.firstTimedTopic() || select.value;
    this.timing.show(select.value);
  }

  /** Return the first topic with a time between messages, or with a latency. */
  firstTimedTopic() {
    const topics = this.runs.flatMap((run) => run.topics);
    const timed = topics.find(
      (topic) => topic.intervals.counts.length || topic.latencies.counts.length,
    );
    return timed && timed.name;
  }

  listen() {
    const on = (id, act) => document.getElementById(id).addEventListener('click', act);
    on('over-time', () => this.switchTo(false));
    on('over-crank', () => this.switchTo(true));
    on('zoom-in', () => this.charts && this.charts.zoom(0.5, this.player.time));
    on('zoom-out', () => this.charts && this.charts.zoom(2, this.player.time));
    on('zoom-all', () => this.charts && this.charts.showAll());
    for (const button of document.querySelectorAll('button[data-time]')) {
      button.addEventListener('click', () => this.jump(button.dataset));
    }
    onThemeChange(() => this.redraw());
  }

  switchTo(isOverCrank) {
    this.isOverCrank = isOverCrank;
    if (!this.legs.length) return;
    this.drawCharts();
    this.player.notify();
  }

  /** Go to the time of a finding, and zoom in. */
  jump({ time, leg }) {
    if (leg && leg !== this.title && this.runs[0].leg(leg)) this.choose(leg);
    if (this.isOverCrank) this.switchTo(false);
    this.player.isPlaying = false;
    this.player.go(Number(time));
    if (!this.charts) return;
    const around = Math.max(this.duration / 40, 0.5);
    this.charts.range(Math.max(time - around, 0), Math.min(Number(time) + around, this.duration));
    document.getElementById('motion').scrollIntoView();
  }

  redraw() {
    for (const drawn of [this.charts, this.path, this.timing]) if (drawn) drawn.redraw();
  }
}

const page = new Page(loadRuns());
// Keys that scroll shall do so without a click before.
document.getElementById('content').focus({ preventScroll: true });
