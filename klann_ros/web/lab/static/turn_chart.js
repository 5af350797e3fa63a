'use strict';
/* The chart of the transmission angles over the crank angle. */

/** The chart of the transmission angles over the crank angle. */
class TurnChart {
  constructor(svg, lab) {
    this.svg = svg;
    this.lab = lab;
    lab.on('turn', () => this.draw());
    for (const event of ['pose', 'numbers', 'linkage']) lab.on(event, () => this.mark());
    svg.addEventListener('click', (event) => {
      const box = svg.getBoundingClientRect();
      const x = ((event.clientX - box.left) / box.width) * 400;
      const degrees = Math.min(Math.max((x - 34) / 356, 0), 1) * 360;
      const step = roundStep((360 / 356) * (400 / box.width));
      lab.turnNear(rounded(degrees, step) * (TAU / 360));
    });
  }

  at(alpha, mu) {
    return [34 + (356 * alpha) / TAU, 150 - (140 * mu) / Math.PI];
  }

  add(name, className, attributes) {
    const node = document.createElementNS(SVG, name);
    node.setAttribute('class', className);
    for (const [key, value] of Object.entries(attributes)) node.setAttribute(key, value);
    this.svg.append(node);
    return node;
  }

  draw() {
    const { turn, linkage } = this.lab;
    this.svg.replaceChildren();
    this.band('chart-good', [0, TAU], [(40 / 360) * TAU, (140 / 360) * TAU]);
    if (!turn.isTurn)
      for (const span of deadSpans(turn.arcs)) this.band('chart-dead', span, [0, Math.PI]);
    for (const degrees of [0, 90, 180]) {
      const [, y] = this.at(0, (degrees / 360) * TAU);
      this.add('path', 'chart-axis', { d: `M34 ${y}H390` });
      this.add('text', '', { x: 30, y: y + 4, 'text-anchor': 'end' }).textContent = `${degrees}°`;
    }
    for (const degrees of [0, 90, 180, 270, 360]) {
      const [x] = this.at((degrees / 360) * TAU, 0);
      const anchor = degrees === 360 ? 'end' : 'middle';
      this.add('text', '', {
        x: degrees === 360 ? x + 10 : x,
        y: 166,
        'text-anchor': anchor,
      }).textContent = `${degrees}°`;
    }
    linkage.blocks.forEach((block, k) => {
      const d = turn.pieces.map((poses) => this.line(poses, block)).join('');
      this.add('path', this.lineClass(k), { d });
    });
    this.now = this.add('path', 'chart-now', { d: '' });
    this.describe();
    this.mark();
  }

  describe() {
    const known = this.lab.turn.angles.filter(({ least }) => Number.isFinite(least));
    const list = known.map(({ least, greatest }, k) =>
      say('dyad', k + 1, degreesText(least), degreesText(greatest)),
    );
    this.svg.setAttribute('aria-label', say('chartLabel', list.join('; ') || say('nowhere')));
    byId('legend').replaceChildren(
      ...list.map((text, k) => {
        const item = made('span');
        const key = document.createElementNS(SVG, 'svg');
        const line = document.createElementNS(SVG, 'path');
        key.setAttribute('aria-hidden', 'true');
        line.setAttribute('class', this.lineClass(k));
        line.setAttribute('d', 'M0 4H34');
        key.append(line);
        item.append(key, text);
        return item;
      }),
    );
  }

  lineClass(k) {
    return `chart-line dash-${k % 5} colour-${(k + 1) % BODY_COLOURS}`;
  }

  band(className, [from, to], [low, high]) {
    const [x, y] = this.at(from, high);
    const [right, bottom] = this.at(to, low);
    this.add('rect', className, { x, y, width: Math.max(0, right - x), height: bottom - y });
  }

  line(poses, block) {
    let before = NaN;
    return poses
      .map((pose) => {
        const alpha = ((pose.x[0] % TAU) + TAU) % TAU;
        const [x, y] = this.at(alpha, block.transmissionAngle(pose.u));
        const pen = alpha >= before ? 'L' : 'M';
        before = alpha;
        return `${pen}${x.toFixed(1)} ${y.toFixed(1)}`;
      })
      .join('');
  }

  mark() {
    if (!this.now) return;
    const [x] = this.at(((this.lab.alpha % TAU) + TAU) % TAU, 0);
    this.now.setAttribute('d', `M${x} 10V150`);
  }
}

/** Return the spans of a turn that are in no arc. */
function deadSpans(arcs) {
  const spans = [];
  let from = 0;
  const inTurn = arcs.flatMap(([start, end]) =>
    end > TAU
      ? [
          [start, TAU],
          [0, end - TAU],
        ]
      : [[start, end]],
  );
  for (const [start, end] of inTurn.sort((a, b) => a[0] - b[0])) {
    if (start > from) spans.push([from, start]);
    from = Math.max(from, end);
  }
  return from < TAU ? [...spans, [from, TAU]] : spans;
}
