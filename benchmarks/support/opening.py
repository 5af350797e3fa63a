"""How long a page takes to open in a browser without a window."""

from pathlib import Path
from statistics import median
from time import monotonic

from browser import find

from .aims import sized

ROUNDS = sized(1, 5)
# When it was parsed and laid out, and first painted, since it was asked for [ms].
_TIMES = """() => new Promise(done => {
  const [load] = performance.getEntriesByType('navigation');
  new PerformanceObserver(found => {
    for (const paint of found.getEntriesByName('first-contentful-paint')) {
      done([load.loadEventEnd, paint.startTime]);
    }
  }).observe({ type: 'paint', buffered: true });
})"""


def opening(page: Path) -> tuple[float, float, float] | None:
    """
    Return when a page is loaded, first painted, and laid out to its end [s]; medians.

    None if there is no Playwright, or no Chromium.
    """
    try:
        from playwright.sync_api import sync_playwright  # noqa: PLC0415 - it may be missing
    except ImportError:
        return None
    found = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=find(), args=['--no-sandbox'])
        for _ in range(ROUNDS):
            context = browser.new_context()
            tab = context.new_page()
            begin = monotonic()
            tab.goto(page.as_uri(), wait_until='load')
            # To say where the last thing is, all has to be laid out.
            tab.evaluate('document.body.lastElementChild.getBoundingClientRect().bottom')
            tab.evaluate('new Promise(done => requestAnimationFrame(() => setTimeout(done)))')
            whole = monotonic() - begin
            loaded, painted = tab.evaluate(_TIMES)
            found.append((loaded / 1e3, painted / 1e3, whole))
            context.close()
        browser.close()
    loads, paints, wholes = zip(*found, strict=True)
    return median(loads), median(paints), median(wholes)
