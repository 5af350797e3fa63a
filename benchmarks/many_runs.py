"""
What it costs to judge many runs of ten minutes at 200 Hz, with a fault of each kind in some.

One run is written; the others are links to its file, so that they need no disk: each is read and
judged for itself all the same, and has a page. The index of all is then opened in a browser, where
there is one. An argument is how many: 60, with --full 1,000.
"""

import os
from pathlib import Path
from statistics import median
import sys
import tempfile
from time import monotonic

from browser import find
from klann_ros.review.fleet.rows import rows_from_table
from support.aims import exit_code, sized
from support.long_run import write_long_run
from support.programs import command, finished

# Runs, and the period of those with a fault, of each kind in turn.
RUNS, EVERY = sized(3, 60, 1000), sized(2, 10, 50)
RUN_SECONDS = sized(5.0, 600.0)
# The aims: time of a thousand [s], the memory of the largest process [MB], and how long the index
# takes to open [s].
MOST_TIME, MOST_MEMORY, MOST_OPENING = 600.0, 600.0, 1.0
# When it was parsed and laid out, and first painted, since it was asked for [ms].
_TIMES = """() => new Promise(done => {
  const [load] = performance.getEntriesByType('navigation');
  new PerformanceObserver(found => {
    for (const paint of found.getEntriesByName('first-contentful-paint')) {
      done([load.loadEventEnd, paint.startTime]);
    }
  }).observe({ type: 'paint', buffered: true });
})"""


def make(root: Path, count: int) -> dict[str, int]:
    """Make the runs; return how many there are of each verdict that is to be expected."""
    good = root / 'good'
    write_long_run(good, RUN_SECONDS, 200.0)
    (log,) = good.glob('*.mcap')
    data = log.read_bytes()
    faults = {
        'cut off': data[: len(data) // 2],
        'a byte flipped': _flipped(data),
        'no log': b'# not a log\n' * 100,
        'empty': b'',
    }
    expected = {'ok': 1, 'findings': 0, 'unreadable': 0}
    kinds = list(faults)
    for number in range(1, count):
        run = root / f'run_{number:04}'
        run.mkdir()
        if number % EVERY:
            os.link(log, run / 'run.mcap')
            expected['ok'] += 1
            continue
        kind = kinds[number // EVERY % len(kinds)]
        (run / 'run.mcap').write_bytes(faults[kind])
        expected['unreadable' if kind in ('no log', 'empty') else 'findings'] += 1
    return expected


def _flipped(data: bytes) -> bytes:
    flipped = bytearray(data)
    flipped[len(data) // 3] ^= 0xFF
    return bytes(flipped)


def opening(page: Path) -> tuple[float, float, float] | None:
    """Return when a page is loaded, painted and laid out [s], medians; None without Playwright."""
    try:
        from playwright.sync_api import sync_playwright  # noqa: PLC0415 - it may be missing
    except ImportError:
        return None
    found = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=find(), args=['--no-sandbox'])
        for _ in range(sized(1, 5)):
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


def main() -> int:
    """Print the figures; return 0 if the aims are met."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else RUNS
    with tempfile.TemporaryDirectory() as work:
        runs, table = Path(work, 'runs'), Path(work, 'table.csv')
        runs.mkdir()
        expected = make(runs, count)
        asked = '--each', runs, '--table', table, '--html', f'{work}/index.html'
        _, seconds, cpu, memory = finished(command('review', *asked))
        rows = rows_from_table(str(table))
        verdicts = {verdict: sum(row.verdict == verdict for row in rows) for verdict in expected}
        index = Path(work, 'index.html').stat().st_size / 1e6
        opened = opening(Path(work, 'index.html'))
    share = count / 1000
    is_met = verdicts == expected and seconds <= MOST_TIME * share and memory <= MOST_MEMORY
    print(f'{count} runs: {seconds:.0f} s, {cpu:.0f} s of CPU, {memory:.0f} MB, {verdicts}')
    print(f'a run: {seconds / count:.2f} s; the index has {index:.2f} MB')
    if opened is None:
        print('no browser here: the index is not opened')
    else:
        loaded, painted, whole = opened
        print(f'the index: painted after {painted:.2f} s, loaded {loaded:.2f}, whole {whole:.2f}')
        is_met = is_met and loaded <= MOST_OPENING
    print('met' if is_met else f'not met: {MOST_TIME * share:.0f} s, {expected}')
    return exit_code(is_met)


if __name__ == '__main__':
    sys.exit(main())
