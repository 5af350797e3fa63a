"""README and manual: links that lead somewhere, examples that run, nothing that is not so."""

from collections.abc import Iterator
from pathlib import Path
import re
from subprocess import CompletedProcess

from fork_server import called, PYTHON
from klann_ros import executables
from klann_ros.kinematics import LinkageLeg
from klann_ros.kinematics.linkage.file import linkage_from_text
from leg_runs import LegRun
import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
README = ROOT / 'README.md'
MANUAL = sorted((ROOT / 'docs').glob('*.md'))
PAGES = [README, ROOT / 'CONTRIBUTING.md', ROOT / 'SECURITY.md', *MANUAL]
# Their blocks are held to more by tests of their own.
RUN_ELSEWHERE = {'courses.md', 'cursos.md', 'ensino.md', 'python_pt.md', 'theory.md', 'teoria.md'}


def blocks(page: Path, language: str) -> list[str]:
    text = page.read_text(encoding='utf-8')
    return re.findall(rf'^```{language}\n(.*?)^```', text, re.DOTALL | re.MULTILINE)


def prose(page: Path) -> str:
    return re.sub(r'(?ms)^```.*?^```', '', page.read_text(encoding='utf-8'))


def anchors(page: Path) -> set[str]:
    """Return the names that a page's headings get where Markdown is shown."""
    titles = re.findall(r'^#+ (.*)$', prose(page), re.MULTILINE)
    return {re.sub(r'[^\w\- ]', '', title.lower()).replace(' ', '-') for title in titles}


def links(page: Path) -> Iterator[tuple[Path, str]]:
    """Yield the relative links of a page: the file, and the place in it."""
    for link in re.findall(r'\]\(([^)\s]+)\)', prose(page)):
        if '://' not in link:
            name, _, place = link.partition('#')
            yield ((page.parent / name).resolve() if name else page), place


def run(source: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> CompletedProcess[str]:
    script = folder / 'example.py'
    script.write_text(source, encoding='utf-8')
    monkeypatch.chdir(folder)
    monkeypatch.setenv('MPLBACKEND', 'Agg')
    return called(PYTHON, script, patience=600.0)


@pytest.mark.parametrize('page', PAGES, ids=lambda page: page.name)
def test_every_relative_link_leads_somewhere(page: Path) -> None:
    for file, place in links(page):
        assert file.exists(), file
        assert not place or place in anchors(file), f'{file}#{place}'


@pytest.mark.parametrize('page', PAGES, ids=lambda page: page.name)
def test_every_file_that_is_named_exists(page: Path) -> None:
    tops = 'klann_ros|examples|scripts|benchmarks|test|docs|config|launch|urdf|foxglove'
    named = re.findall(rf'`((?:{tops})/[\w/.]+)`', prose(page))
    missing = [name for name in named if not (ROOT / name).exists()]
    assert missing == []


def test_every_page_of_the_manual_is_found_from_its_contents() -> None:
    index = ROOT / 'docs' / 'index.md'
    linked = {file for file, _ in links(index) if file.suffix in {'.md', '.rst'}}
    assert {*MANUAL} - linked == {index}
    # And so from the contents of the built pages.
    groups = re.findall(r'(?ms)^```\{toctree\}\n.*?\n\n(.*?)^```', index.read_text())
    listed = {(index.parent / name).resolve() for name in ' '.join(groups).split()}
    assert listed == {file.with_suffix('') for file in linked}


def test_every_folder_has_its_row_and_every_library_its_reference() -> None:
    folders = {path.parent.name for path in (ROOT / 'klann_ros').glob('*/__init__.py')}
    rows = re.findall(r'^\| `klann_ros/(\w+)/` \|', prose(ROOT / 'CONTRIBUTING.md'), re.MULTILINE)
    assert {*rows} == folders | {'linkages'}
    pages = {path.stem for path in (ROOT / 'docs' / 'api').glob('*.rst')} - {'index'}
    internal = {'cli', 'importing', 'live', 'messages', 'nodes', 'web', 'sanitize'}
    assert pages == folders - internal | {'engines'}


def test_the_page_of_review_explains_every_check() -> None:
    folder = ROOT / 'klann_ros' / 'review' / 'checks'
    source = ''.join(path.read_text(encoding='utf-8') for path in folder.glob('*.py'))
    names = {*re.findall(r"Finding\(\s*'(\w+)'", source)}
    table = re.findall(r'^\| (`.*?) \|', prose(ROOT / 'docs' / 'review.md'), re.MULTILINE)
    explained = {*re.findall(r'`(\w+)`', ' '.join(table))}
    assert len(names) > 12
    assert names - explained == set()
    assert {name for name in explained if name.islower()} - names == set()


def test_the_readme_is_read_at_one_sitting() -> None:
    assert len(README.read_text(encoding='utf-8').splitlines()) <= 150


def test_the_contents_of_the_manual_name_every_executable() -> None:
    source = Path(executables.__file__).read_text(encoding='utf-8')
    names = re.findall(r'^(\w+) = partial\(', source, re.MULTILINE)
    assert len(names) > 10
    for name in names:
        assert f'- `{name}' in (ROOT / 'docs' / 'index.md').read_text(encoding='utf-8')


def test_the_readmes_first_example_is_warm_started(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    done = run(blocks(README, 'python')[0], tmp_path, monkeypatch)
    assert (done.returncode, done.stderr) == (0, '')
    steps = [line.split() for line in done.stdout.splitlines() if line[0] != '[']
    assert [int(step[0]) for step in steps] == list(range(0, 360, 10))
    # A step that is split takes the iterations of all its parts.
    assert max(int(step[-1]) for step in steps) <= 5


@pytest.mark.parametrize(
    'page',
    [page for page in PAGES if page.name not in RUN_ELSEWHERE and blocks(page, 'python')],
    ids=lambda page: page.name,
)
def test_the_examples_of_a_page_run(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # One after the other, as a reader types them: a later one knows the names of the earlier.
    source = '\n'.join(blocks(page, 'python'))
    if 'klann_ros.plotting' in source:
        pytest.importorskip('matplotlib')
    LegRun(count=600).write(tmp_path / 'runs' / 'first')
    if page.name == 'adding_a_linkage.md':
        described = blocks(page, 'yaml')[0]
        (tmp_path / 'watt.yaml').write_text(described, encoding='utf-8')
    done = run(source, tmp_path, monkeypatch)
    assert (done.returncode, done.stderr) == (0, '')


def test_the_bend_of_a_sliding_body_counts_from_the_body_that_carries_its_line() -> None:
    text = blocks(ROOT / 'docs' / 'adding_a_linkage.md', 'yaml')[1]
    linkage = linkage_from_text(text, 'the example')
    points = LinkageLeg(linkage).solve(0.7).points
    c, h = (points[linkage.structure.points.index(name)] for name in 'CH')
    assert np.degrees(np.arctan2(c[1], c[0])) == pytest.approx(20.0)
    assert np.degrees(np.arctan2(h[1] - c[1], h[0] - c[0])) == pytest.approx(90.0)


def test_the_slider_crank_by_coordinates_is_in_the_pose_of_its_points() -> None:
    text = blocks(ROOT / 'docs' / 'adding_a_linkage.md', 'yaml')[2]
    linkage = linkage_from_text(text, 'the example')
    points = LinkageLeg(linkage).solve(np.arctan2(24.0, 18.0)).points
    places = dict(zip(linkage.structure.points, points, strict=True))
    assert places['C'] == pytest.approx((0.114, -0.004))
    assert places['P'] == pytest.approx((0.06, 0.02))
