'use strict';
/* The two lectures: which linkage is whose, and how each works and prints Newton-Raphson. */

const NEWTON_TOLERANCE = 1e-12;
// What the four-bar course keeps in its steps: decimals of a correction [rad], of an estimate [deg].
const CORRECTION_DIGITS = [4, 4, 6, 8];
const ESTIMATE_DIGITS = [3, 3, 4, 7];
// The fourth estimate of theta4 in its example; it prints 72.1377.
const RIGHT_ESTIMATE = 72.1376;

function digitsOf(list, k) {
  return list[Math.min(k, list.length - 1)];
}

const COURSES = {
  // It iterates with all digits, and prints angles that it has rounded in radians.
  sem104: {
    rounding: UNROUNDED,
    tolerance: NEWTON_TOLERANCE,
    printed: (angle) => rounded(angle, 1e-4),
    digits: () => 4,
  },
  // It goes on with rounded corrections, until f is below its uncertainty.
  fourBar: {
    rounding: {
      // 0.0001 mm.
      uncertainty: 1e-7,
      correction: (value, k) => rounded(value, 10 ** -digitsOf(CORRECTION_DIGITS, k)),
      iterate: (value, k) =>
        (rounded((value * 360) / TAU, 10 ** -digitsOf(ESTIMATE_DIGITS, k)) * TAU) / 360,
    },
    // The last of these decimals: no correction can be less but 0.
    tolerance: 1e-8,
    printed: (angle) => angle,
    digits: (k) => digitsOf(ESTIMATE_DIGITS, Math.max(k - 1, 0)),
  },
};
const NO_COURSE = {
  rounding: UNROUNDED,
  tolerance: NEWTON_TOLERANCE,
  printed: (angle) => angle,
  digits: () => 6,
};

/** Return the name of the lecture whose letters a linkage has, or ''. */
function courseOf({ structure }, isKlann) {
  if (isKlann) return 'sem104';
  return structure.angles.join() === 'theta2,theta3,theta4' && !structure.slides ? 'fourBar' : '';
}
