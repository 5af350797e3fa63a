'use strict';
/* What scrolls sideways is reached by the keyboard. */
for (const box of document.querySelectorAll('div.math, .table-wrapper, pre'))
  if (box.scrollWidth > box.clientWidth) box.tabIndex = 0;
