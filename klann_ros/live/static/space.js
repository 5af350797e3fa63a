'use strict';
/* From a leg's plane to base_link, and from there to the views from the side and from above. */

const TURN = 2 * Math.PI;

/** Return the axes of a plane in base_link, by its roll, pitch and yaw about fixed axes. */
function axesOf([roll, pitch, yaw]) {
  const [a, b, c] = [roll, pitch, yaw].map(Math.cos);
  const [d, e, f] = [roll, pitch, yaw].map(Math.sin);
  return [
    [c * b, f * b, -e],
    [c * e * d - f * a, f * e * d + c * a, b * d],
  ];
}

/** Return points (x, y) of a mounted plane in base_link: (x, y, z). */
function mounted(points, mount) {
  const [u, v] = axesOf(mount.rpy);
  return points.map(([x, y]) => [0, 1, 2].map((i) => mount.xyz[i] + x * u[i] + y * v[i]));
}

const VIEWS = {
  side: ([x, , z]) => [x, z],
  above: ([x, y]) => [x, y],
};

/** Return an angle within half a turn. */
function wrapped(angle) {
  return angle - TURN * Math.round(angle / TURN);
}

function degrees(angle) {
  return (angle * 360) / TURN;
}
