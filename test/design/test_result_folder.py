"""The folder of a search: files of others stay, a crash loses nothing, one search at a time."""

from collections.abc import Callable, Iterator, Mapping
import json
from pathlib import Path
import re
from shutil import copytree
import signal
import subprocess
import sys
from typing import Any

from klann_ros.cli import OutputError, UsageError
from klann_ros.design import requirements_from, search, SearchResult, State
from klann_ros.design.leg_file import parameter_text
from klann_ros.design.page import page
from klann_ros.design.result_folder import opened_folder, ResultFolder
import pytest

HOLDER = """
import pathlib, sys, time
from klann_ros.design.leg_file import parameter_text
from klann_ros.design.page import page
from klann_ros.design.result_folder import opened_folder
with opened_folder(pathlib.Path(sys.argv[1]), resume=True):
    print('locked', flush=True)
    time.sleep(60)
"""


@pytest.fixture(scope='module', autouse=True)
def walkers_drawn_once() -> Iterator[None]:
    """Compute the parts of a walker, which take a second, for its first page only."""
    module = sys.modules[page.__module__]
    compute_parts = module._walker_parts
    parts: dict[str, Any] = {}

    def stored_parts(walker: Mapping[str, Any]) -> Any:
        text = parameter_text(walker)
        if text not in parts:
            parts[text] = compute_parts(walker)
        return parts[text]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, '_walker_parts', stored_parts)
        yield


@pytest.fixture(scope='module')
def design() -> SearchResult:
    content = {
        'linkage': 'hoecken',
        'vary': 10,
        'figures': {'stride': 'maximize', 'lift': 'maximize'},
    }
    return search(requirements_from({**content, 'walker': {}, 'count': 3}), evaluations=480)


@pytest.fixture(scope='module')
def smaller_design(design: SearchResult) -> SearchResult:
    """Return another result of the same search: its first legs are other ones."""
    requirements = design.requirements
    return SearchResult(requirements, design.legs[1:], (), design.state, design.seed, {})


@pytest.fixture(scope='module')
def saved_folder(tmp_path_factory: pytest.TempPathFactory, design: SearchResult) -> Path:
    folder = tmp_path_factory.mktemp('saved') / 'out'
    with opened_folder(folder, resume=False) as (result_folder, state):
        assert state is None
        result_folder.save_state(design.state)
        result_folder.save_result(design)
    return folder


@pytest.fixture
def folder(tmp_path: Path, saved_folder: Path) -> Path:
    """Return a folder with a result of three legs."""
    return copytree(saved_folder, tmp_path / 'out')


def replace_result(folder: Path, search_result: SearchResult) -> tuple[list[str], list[str]]:
    with opened_folder(folder, resume=True) as (result_folder, state):
        assert state is not None
        return result_folder.save_result(search_result)


def contents(folder: Path) -> dict[str, str]:
    return {file.name: file.read_text() for file in folder.iterdir() if file.is_file()}


@pytest.mark.slow
def test_a_result_replaces_the_files_of_the_last_one(
    folder: Path, design: SearchResult, smaller_design: SearchResult
) -> None:
    first = contents(folder)
    names = [f'leg_00{n}{ending}.yaml' for n in (1, 2, 3) for ending in ('', '_walker')]
    files = ['.klann-search.lock', 'design.json', 'index.html', *names, 'search.json']
    assert sorted(first) == files
    assert replace_result(folder, smaller_design) == (['leg_001', 'leg_002'], [])
    assert not {'leg_003.yaml', 'leg_003_walker.yaml'} & contents(folder).keys()
    assert replace_result(folder, design)[1] == []
    assert contents(folder) == first


def test_what_somebody_else_wrote_stays_and_is_named(
    folder: Path, smaller_design: SearchResult
) -> None:
    (folder / 'leg_001.yaml').write_text('edited')
    (folder / 'leg_002_walker.yaml').unlink()
    (folder / 'leg_002_walker.yaml').symlink_to(folder / 'leg_003.yaml')
    (folder / 'leg_mine.yaml').write_text('my own')
    (folder / 'leg_005.yaml').mkdir()
    names, foreign_files = replace_result(folder, smaller_design)
    assert names == ['leg_003', 'leg_004']
    assert foreign_files == [
        'leg_001.yaml', 'leg_002_walker.yaml', 'leg_005.yaml', 'leg_mine.yaml'
    ]  # fmt: skip
    assert (folder / 'leg_001.yaml').read_text() == 'edited'
    assert (folder / 'leg_mine.yaml').read_text() == 'my own'
    assert (folder / 'leg_002_walker.yaml').is_symlink()
    # The walker of an edited leg, as the last search wrote it, goes; the page shows the new names.
    assert not (folder / 'leg_001_walker.yaml').exists()
    listed = json.loads((folder / 'design.json').read_text())
    assert [leg['file'] for leg in listed['legs']] == ['leg_003.yaml', 'leg_004.yaml']
    html = (folder / 'index.html').read_text()
    assert 'leg_003' in html
    assert 'leg_001' not in html


def cut_off(file: Path) -> None:
    file.write_bytes(file.read_bytes()[:-100])


def edit_a_hash(file: Path) -> None:
    file.write_text(
        re.sub(r'"leg_001.yaml": "\w+"', '"leg_001.yaml": "' + 64 * '0' + '"', file.read_text())
    )


def link(file: Path) -> None:
    file.rename(file.with_name('moved'))
    file.symlink_to('moved')


def as_a_list(file: Path) -> None:
    file.write_text('[]')


def as_a_folder(file: Path) -> None:
    file.unlink()
    file.mkdir()


@pytest.mark.parametrize(
    ('name', 'damage'),
    [
        *[
            ('design.json', damage)
            for damage in (cut_off, edit_a_hash, link, as_a_list, as_a_folder)
        ],
        *[('index.html', damage) for damage in (cut_off, link, as_a_folder)],
        ('search.json', link),
    ],
)
def test_a_result_that_somebody_changed_is_not_replaced(
    folder: Path, design: SearchResult, name: str, damage: Callable[[Path], None]
) -> None:
    damage(folder / name)
    before = contents(folder)
    with pytest.raises(OutputError, match=f'{name} is not as the last search left it'):
        replace_result(folder, design)
    assert contents(folder) == before


@pytest.mark.slow
@pytest.mark.parametrize('saves', range(7))
def test_a_crash_while_files_are_written_leaves_none_that_the_next_search_takes_for_anothers(
    folder: Path,
    design: SearchResult,
    smaller_design: SearchResult,
    saves: int,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    first = contents(folder)
    left: Iterator[int] = iter(range(saves))
    save = ResultFolder._save

    def save_or_die(*arguments: object) -> None:
        if next(left, None) is None:
            raise KeyboardInterrupt
        save(*arguments)

    with monkeypatch.context() as patch:
        patch.setattr(ResultFolder, '_save', save_or_die)
        with pytest.raises(KeyboardInterrupt):
            replace_result(folder, smaller_design)
    assert replace_result(folder, design)[1] == []
    assert contents(folder) == first


def test_a_second_search_in_a_folder_is_refused_until_the_first_one_is_killed(
    folder: Path, design: SearchResult
) -> None:
    command = [sys.executable, '-c', HOLDER, str(folder)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as holder:
        assert holder.stdout is not None
        assert holder.stdout.readline() == 'locked\n'
        with pytest.raises(OutputError, match='another search has not ended'):
            replace_result(folder, design)
        holder.send_signal(signal.SIGKILL)
        holder.wait(timeout=60)
        assert replace_result(folder, design)[1] == []


def test_the_folder_of_a_search_killed_in_its_first_round_is_taken(tmp_path: Path) -> None:
    for resume in (False, False, True):
        with opened_folder(tmp_path / 'out', resume=resume) as (_, state):
            assert state is None


def test_a_state_that_cannot_be_read_is_refused_in_one_line(folder: Path) -> None:
    (folder / 'search.json').write_text('{')
    with pytest.raises(UsageError, match=r'search.json cannot be read: '):
        replace_result(folder, SearchResult(None, (), (), State('', 0, 0, ()), 0, {}))
    with (
        pytest.raises(UsageError, match=r'none/search.json cannot be read: No such file'),
        opened_folder(folder / 'none', resume=True),
    ):
        pass
