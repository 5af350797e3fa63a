/* The reader's choice of light or dark, before the page is drawn: of furo, where it is inline. */
document.body.dataset.theme = localStorage.getItem('theme') || 'auto';
