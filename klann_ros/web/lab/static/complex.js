'use strict';
/* Complex numbers as [re, im], small linear systems, angles, and what is refused. */

const TAU = 2 * Math.PI;
const EPSILON = Number.EPSILON;

const C = {
  add: (a, b) => [a[0] + b[0], a[1] + b[1]],
  sub: (a, b) => [a[0] - b[0], a[1] - b[1]],
  mul: (a, b) => [a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]],
  times: (k, a) => [k * a[0], k * a[1]],
  conj: (a) => [a[0], -a[1]],
  div: (a, b) => {
    const size = b[0] * b[0] + b[1] * b[1];
    return [(a[0] * b[0] + a[1] * b[1]) / size, (a[1] * b[0] - a[0] * b[1]) / size];
  },
  abs: (a) => Math.hypot(a[0], a[1]),
  arg: (a) => Math.atan2(a[1], a[0]),
  polar: (length, angle) => [length * Math.cos(angle), length * Math.sin(angle)],
  /** The cross product of two vectors. */
  cross: (a, b) => a[0] * b[1] - a[1] * b[0],
};

/** What is not taken: one line in each language. */
class Refusal extends Error {
  constructor(en, pt) {
    super(en);
    this.texts = { en, pt };
  }
}

function refuseUnless(condition, en, pt) {
  if (!condition) throw new Refusal(en, pt);
}

/** Return a text of somebody else's as one line that moves nothing but the reader. */
function printable(text, longest = 60) {
  const shown = Array.from(String(text).slice(0, longest), (c) =>
    /[\p{C}\p{Zl}\p{Zp}]/u.test(c) ? `\\u{${c.codePointAt(0).toString(16)}}` : c,
  ).join('');
  return String(text).length > longest ? `${shown}...` : shown;
}

/** Return a number as C's %g writes it. */
function general(value, digits = 6) {
  return String(Number(Number(value).toPrecision(digits)));
}

/** Return the angle in (-pi, pi]. */
function wrap(angle) {
  if (-Math.PI < angle && angle <= Math.PI) return angle;
  const wrapped = angle - TAU * Math.round(angle / TAU);
  return wrapped <= -Math.PI ? Math.PI : wrapped;
}

/** Solve m x = b by Gauss's elimination with row pivots; return {x, det}; x is null if singular. */
function solved(matrix, right) {
  const n = right.length;
  const m = matrix.map((row, i) => [...row, right[i]]);
  let det = 1;
  for (let k = 0; k < n; k += 1) {
    let best = k;
    for (let i = k + 1; i < n; i += 1) if (Math.abs(m[i][k]) > Math.abs(m[best][k])) best = i;
    if (best !== k) {
      [m[k], m[best]] = [m[best], m[k]];
      det = -det;
    }
    det *= m[k][k];
    if (m[k][k] === 0) return { x: null, det: 0 };
    for (let i = k + 1; i < n; i += 1) {
      const t = m[i][k] / m[k][k];
      for (let j = k + 1; j <= n; j += 1) m[i][j] -= t * m[k][j];
    }
  }
  const x = Array(n).fill(0);
  for (let k = n - 1; k >= 0; k -= 1) {
    let sum = m[k][n];
    for (let j = k + 1; j < n; j += 1) sum -= m[k][j] * x[j];
    x[k] = sum / m[k][k];
  }
  return { x, det };
}
