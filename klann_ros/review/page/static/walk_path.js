'use strict';
/* The path of a walking robot from above, by odometry and by ground truth. */

// The robot is a mark of this size, in the drawing's units; it looks along its x axis.
const ROBOT = 'M16 0L-10 10L-5 0L-10 -10Z';
const COLOURS = { odometry: 'accent', 'ground truth': 'second' };

class WalkPath {
  constructor(holder, data, number) {
    this.lines = data.lines.map((line) => ({
      name: line.name,
      colour: COLOURS[line.name],
      dash: line.name === 'odometry' ? [] : [6, 4],
      times: unpacked(line.times),
      at: line.at.map(unpacked),
      yaw: unpacked(line.yaw),
    }));
    const svg = document.createElementNS(SVG, 'svg');
    const text = `${data.text}. A square is where it began, the arrow where it is.`;
    const caption = make('figcaption', '', text);
    caption.id = `walk-text-${number}`;
    svg.setAttribute('class', 'walk-path');
    svg.setAttribute('role', 'img');
    svg.setAttribute('aria-labelledby', caption.id);
    holder.append(make('figure', 'card', namesOf(this.lines), svg, caption));
    this.draw(svg);
  }

  draw(svg) {
    const points = this.lines.map(({ at: [xs, ys] }) => Array.from(xs, (x, i) => [x, ys[i]]));
    this.drawing = new Drawing(svg, planeAround([[0, 0], ...points.flat()]));
    const size = scaleBar(this.drawing);
    // The ground truth below, so that odometry is seen where they agree.
    [...this.lines.keys()].reverse().forEach((i) => {
      const { name, colour } = this.lines[i];
      const kind = `walk-line ink-${colour} ${name === 'odometry' ? '' : 'walk-truth'}`;
      this.drawing.add('path', kind).setAttribute('d', this.drawing.line(points[i]));
      this.lines[i].mark = this.drawing.add('path', `robot ink-${colour}`);
      this.lines[i].mark.setAttribute('d', ROBOT);
    });
    const [x, y] = this.drawing.at([0, 0]);
    const begin = this.drawing.add('rect', 'pivot');
    begin.setAttribute('width', 9);
    begin.setAttribute('height', 9);
    begin.setAttribute('x', x - 4.5);
    begin.setAttribute('y', y - 4.5);
    svg.dataset.bar = size;
  }

  show(time) {
    for (const { times, at, yaw, mark } of this.lines) {
      const row = nearestIn(times, time);
      const [x, y] = this.drawing.at(at.map((column) => column[row]));
      mark.setAttribute('transform', `translate(${x} ${y}) rotate(${(-yaw[row] * 180) / Math.PI})`);
    }
  }
}

/** Draw a scale bar of a round number of metres; return that number. */
function scaleBar(drawing) {
  const { scale, height } = drawing.plane;
  const most = 160 / scale;
  const decade = 10 ** Math.floor(Math.log10(most));
  const metres = [5, 2, 1].map((n) => n * decade).find((n) => n <= most);
  const y = height - 12;
  drawing.add('path', 'scale-bar').setAttribute('d', `M12 ${y - 6}V${y}H${12 + metres * scale}V${y - 6}`);
  const text = drawing.add('text', 'scale-text');
  text.textContent = `${Number(metres.toPrecision(1))} m`;
  text.setAttribute('x', 18);
  text.setAttribute('y', y - 6);
  return metres;
}

/** Show the paths of all robots; return a function that shows them at a time. */
function showWalks(runs) {
  const walks = runs.flatMap((run) => run.walks);
  document.getElementById('walks').hidden = !walks.length;
  const holder = document.getElementById('walk-figures');
  const shown = walks.map((walk, number) => new WalkPath(holder, walk, number));
  return (time) => shown.forEach((path) => path.show(time));
}
