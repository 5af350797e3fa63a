'use strict';
/* What scrolls sideways is reached by the keyboard, and both columns of links have a name. */
for (const box of document.querySelectorAll('div.math, .table-wrapper, pre'))
  if (box.scrollWidth > box.clientWidth) box.tabIndex = 0;
const isPortuguese = document.documentElement.lang.startsWith('pt');
for (const [column, english, portuguese] of [
  ['.sidebar-drawer', 'Pages', 'Páginas'],
  ['.toc-drawer', 'On this page', 'Nesta página'],
])
  document.querySelector(column)?.setAttribute('aria-label', isPortuguese ? portuguese : english);
