'use strict';
/* The lines of the foot's path: their data, extent and drawing. */

function pathLines(leg, run, isOneOfTwo) {
  const name = isOneOfTwo ? `${'AB'[run]}: ` : '';
  const colour = run ? 'second' : 'accent';
  const lines = [];
  if (leg.path) {
    const dash = run ? [2, 3] : [6, 4];
    const ends = leg.shape.closed ? leg.path.map((s) => [...s, s[0]]) : leg.path;
    lines.push({
      name: `${name}by the geometry`,
      colour: run ? 'second' : 'quiet',
      dash,
      width: 1,
      data: ends,
      breaks: new Set(),
    });
  }
  const breaks = leg.gaps.map(([time]) => nearestIn(leg.times, time));
  lines.push({
    name: `${name}recorded`,
    colour,
    dash: [],
    width: 1.75,
    data: leg.foot,
    breaks: new Set(breaks),
    // Lines between poses far apart would cross the path.
    isDots: leg.count < leg.of,
  });
  return lines;
}

function extentOf(lines) {
  const box = { left: Infinity, right: -Infinity, bottom: Infinity, top: -Infinity };
  for (const {
    data: [xs, ys],
  } of lines) {
    xs.forEach((x, i) => {
      if (!Number.isFinite(x) || !Number.isFinite(ys[i])) return;
      box.left = Math.min(box.left, x);
      box.right = Math.max(box.right, x);
      box.bottom = Math.min(box.bottom, ys[i]);
      box.top = Math.max(box.top, ys[i]);
    });
  }
  if (box.left > box.right) return { left: -1, right: 1, bottom: -1, top: 1 };
  const rim = 0.06 * Math.max(box.right - box.left, box.top - box.bottom);
  return {
    left: box.left - rim,
    right: box.right + rim,
    bottom: box.bottom - rim,
    top: box.top + rim,
  };
}

/** Draw a line through points in their order; steps within a pixel are left out. */
function paintLine(u, { data: [xs, ys], colour, dash, width, breaks }) {
  const { ctx } = u;
  const ratio = devicePixelRatio;
  beginIn(u);
  let last = null;
  for (let i = 0; i < xs.length; i += 1) {
    if (!Number.isFinite(xs[i]) || !Number.isFinite(ys[i])) {
      last = null;
    } else {
      const x = u.valToPos(xs[i], 'x', true);
      const y = u.valToPos(ys[i], 'y', true);
      if (!last) ctx.moveTo(x, y);
      if (!last || Math.abs(x - last[0]) > 0.7 || Math.abs(y - last[1]) > 0.7) {
        ctx.lineTo(x, y);
        last = [x, y];
      }
      if (breaks.has(i)) last = null;
    }
  }
  ctx.strokeStyle = themeColour(colour);
  ctx.lineWidth = width * ratio;
  ctx.lineJoin = 'round';
  ctx.setLineDash(dash.map((size) => size * ratio));
  ctx.stroke();
  ctx.restore();
  return null;
}

function paintDots(u, { data: [xs, ys], colour, width }) {
  const { ctx } = u;
  const size = width * devicePixelRatio;
  beginIn(u);
  for (let i = 0; i < xs.length; i += 1) {
    if (Number.isFinite(xs[i]) && Number.isFinite(ys[i])) {
      ctx.rect(
        u.valToPos(xs[i], 'x', true) - size / 2,
        u.valToPos(ys[i], 'y', true) - size / 2,
        size,
        size,
      );
    }
  }
  ctx.fillStyle = themeColour(colour);
  ctx.fill();
  ctx.restore();
  return null;
}

/** Begin a path that ends at the plot's edges. */
function beginIn({ ctx, bbox }) {
  ctx.save();
  ctx.beginPath();
  ctx.rect(bbox.left, bbox.top, bbox.width, bbox.height);
  ctx.clip();
  ctx.beginPath();
}

function nearestFoot(leg, x, y) {
  const [xs, ys] = leg.foot;
  let [found, least] = [-1, Infinity];
  for (let row = 0; row < xs.length; row += 1) {
    const distance = (xs[row] - x) ** 2 + (ys[row] - y) ** 2;
    if (distance < least) [found, least] = [row, distance];
  }
  return found;
}
