"""
The cost of judging many runs of ten minutes at 200 Hz, with a fault of each kind in some.

One run is written; the others are links to its file, which need no disk. Each is read and judged,
and has a page. The index of all is then opened in a browser, where there is one. The argument is
the number of runs: 60, with --full 1,000.
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
RUNS = sized(3, 60, 1000)
FAULT_PERIOD = sized(2, 10, 50)
RUN_SECONDS = sized(5.0, 600.0)
# The aims: time of a thousand runs [s], memory of the largest process [MB], and time until the
# index is loaded [s].
MAX_TIME = 600.0
MAX_MEMORY = 600.0
MAX_LOADING_TIME = 1.0
# Times from the request of the page until it was parsed and laid out, and first painted [ms].
_TIMES = """() => new Promise(done => {
  const [load] = performance.getEntriesByType('navigation');
  new PerformanceObserver(list => {
    for (const paint of list.getEntriesByName('first-contentful-paint')) {
      done([load.loadEventEnd, paint.startTime]);
    }
  }).observe({ type: 'paint', buffered: true });
})"""


def write_runs(root: Path, count: int) -> dict[str, int]:
    """Write the runs; return the expected number of each verdict."""
    healthy_run = root / 'good'
    write_long_run(healthy_run, RUN_SECONDS, 200.0)
    (log,) = healthy_run.glob('*.mcap')
    healthy = log.read_bytes()
    with_error = bytearray(healthy)
    with_error[len(healthy) // 3] ^= 0xFF
    faulty_logs = (
        ('findings', healthy[: len(healthy) // 2]),
        ('findings', bytes(with_error)),
        ('unreadable', b'# not a log\n' * 100),
        ('unreadable', b''),
    )
    expected = {'ok': 1, 'findings': 0, 'unreadable': 0}
    for number in range(1, count):
        run = root / f'run_{number:04}'
        run.mkdir()
        if number % FAULT_PERIOD:
            os.link(log, run / 'run.mcap')
            expected['ok'] += 1
            continue
        verdict, content = faulty_logs[number // FAULT_PERIOD % len(faulty_logs)]
        (run / 'run.mcap').write_bytes(content)
        expected[verdict] += 1
    return expected


def time_opening(page: Path) -> tuple[float, float, float] | None:
    """Return when a page is loaded, painted and laid out [s], medians; None without Playwright."""
    try:
        from playwright.sync_api import sync_playwright  # noqa: PLC0415 - it may be missing
    except ImportError:
        return None
    times = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=find(), args=['--no-sandbox'])
        for _ in range(sized(1, 5)):
            context = browser.new_context()
            tab = context.new_page()
            start_time = monotonic()
            tab.goto(page.as_uri(), wait_until='load')
            # The position of the last element needs the layout of all.
            tab.evaluate('document.body.lastElementChild.getBoundingClientRect().bottom')
            tab.evaluate('new Promise(done => requestAnimationFrame(() => setTimeout(done)))')
            layout_time = monotonic() - start_time
            loading_time, painting_time = tab.evaluate(_TIMES)
            times.append((loading_time / 1e3, painting_time / 1e3, layout_time))
            context.close()
        browser.close()
    loading_times, painting_times, layout_times = zip(*times, strict=True)
    return median(loading_times), median(painting_times), median(layout_times)


def main() -> int:
    """Print the figures; return 0 if the aims are met."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else RUNS
    with tempfile.TemporaryDirectory() as work:
        runs = Path(work, 'runs')
        runs.mkdir()
        expected = write_runs(runs, count)
        table = Path(work, 'table.csv')
        index = Path(work, 'index.html')
        line = command('review', '--each', runs, '--table', table, '--html', index)
        _, seconds, cpu, memory = finished(line)
        verdicts = dict.fromkeys(expected, 0)
        for run in rows_from_table(str(table)):
            verdicts[run.verdict] += 1
        index_size = index.stat().st_size / 1e6
        opening_times = time_opening(index)
    max_time = MAX_TIME * count / 1000
    is_met = verdicts == expected and seconds <= max_time and memory <= MAX_MEMORY
    print(f'{count} runs: {seconds:.0f} s, {cpu:.0f} s of CPU, {memory:.0f} MB, {verdicts}')
    print(f'a run: {seconds / count:.2f} s; the index has {index_size:.2f} MB')
    if opening_times is None:
        print('no browser here: the index is not opened')
    else:
        loaded, painted, laid_out = opening_times
        print(
            f'the index: painted after {painted:.2f} s, loaded {loaded:.2f}, whole {laid_out:.2f}'
        )
        is_met = is_met and loaded <= MAX_LOADING_TIME
    print('met' if is_met else f'not met: {max_time:.0f} s, {expected}')
    return exit_code(is_met)


if __name__ == '__main__':
    sys.exit(main())
