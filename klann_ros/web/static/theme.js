'use strict';
/*
 * Colours come from the style sheet, so that charts follow the page into the dark and onto paper.
 * Numbers in texts: fixedText(number, digits) is as toFixed, and no number is -0.
 */

// A dash pattern beside each colour, for readers who cannot tell colours apart.
const DASHES = [[], [8, 3], [2, 3], [10, 3, 2, 3], [5, 2], [1, 2], [12, 3]];

function themeColour(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}

function bodyColour(index) {
  return themeColour(`body-${index % BODY_COLOURS}`);
}

/** Call a function when the colours change: in dark mode, or on paper. */
function onThemeChange(redraw) {
  for (const query of ['(prefers-color-scheme: dark)', 'print']) {
    matchMedia(query).addEventListener('change', redraw);
  }
}

/** Return a number with some digits after the point, and 0 without a sign. */
function fixedText(number, digits) {
  return number.toFixed(digits).replace(/^-(?=[0.]+$)/, '');
}
