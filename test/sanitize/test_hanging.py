"""No program blocks on a file that is not regular, or reads one without an end: real processes."""

import os
from pathlib import Path
import re
import socket
import struct

import fork_server
from klann_ros.kinematics import KlannLeg
from klann_ros.log.mcap.records import MAGIC
from leg_runs import LegRun
from patience import PATIENCE
import pytest

SPARSE = 2**40
# A reader of an endless file is stopped by this [bytes].
MEMORY = 3 * 2**30
KINDS = ('pipe', 'link to a pipe', 'socket', '/dev/zero', 'folder', 'sparse')


@pytest.fixture
def run(tmp_path) -> Path:
    """Return a run that explains itself, of 80 messages."""
    leg = KlannLeg()
    made = LegRun({'': leg}, parameters=leg.geometry.as_dict(), count=40, iterations=False)
    return made.write(tmp_path / 'run')


def make(kind: str, path: Path) -> None:
    """Put something at a path that is no file with an end."""
    path.unlink(missing_ok=True)
    if kind == 'pipe':
        os.mkfifo(path)
    elif kind == 'link to a pipe':
        os.mkfifo(path.with_name('.pipe'))
        path.symlink_to('.pipe')
    elif kind == 'socket':
        # A socket's path must be short.
        with socket.socket(socket.AF_UNIX) as made:
            folder = os.open(path.parent, os.O_RDONLY)
            made.bind(f'/proc/self/fd/{folder}/{path.name}')
            os.close(folder)
    elif kind == '/dev/zero':
        path.symlink_to('/dev/zero')
    elif kind == 'folder':
        path.mkdir()
    else:
        with path.open('wb') as file:
            file.truncate(SPARSE)


def called(name: str, *arguments: object) -> tuple[int, str, str]:
    """Run a tool, which must come to an end with little memory; return what came of it."""
    done = fork_server.called(name, *arguments, memory=MEMORY, patience=PATIENCE)
    return done.returncode, done.stdout, done.stderr


@pytest.mark.parametrize('kind', KINDS)
def test_a_special_file_as_log_is_refused_in_one_line(tmp_path, kind: str) -> None:
    log = tmp_path / 'log.mcap'
    make(kind, log)
    for tool in ('review', 'recover'):
        code, output, errors = called(tool, log)
        assert (code, output) == (2, '')
        assert errors.startswith(f'{tool}: {log} is not a readable log: ')
        assert errors.count('\n') == 1


@pytest.mark.parametrize('tool', ['review', 'recover', 'player_node'])
def test_an_empty_path_is_not_the_folder_one_is_in(tool: str) -> None:
    code, output, errors = called(tool, '')
    assert (code, output) == (2, '')
    *_, line = errors.splitlines()
    assert line == f'{tool}: error: argument LOG: it is empty; is a variable not set?'


@pytest.mark.parametrize(('kind', 'named'), [*((kind, True) for kind in KINDS), ('pipe', False)])
def test_the_good_files_of_a_folder_are_read_and_the_other_is_named(
    run: Path, tmp_path, kind: str, named: bool
) -> None:
    other = run / 'run_1.mcap'
    make(kind, other)
    metadata = run / 'metadata.yaml'
    if named:
        text = metadata.read_text()
        metadata.write_text(text.replace('- run_0.mcap', '- run_0.mcap\n  - run_1.mcap'))
    else:
        metadata.unlink()
    code, output, errors = called('review', run)
    assert (code, errors) == (1, '')
    assert 'run_1.mcap' in output
    assert re.search(r'^/joint_states +40 ', output, re.MULTILINE)
    code, output, errors = called('recover', run, '-o', tmp_path / 'again')
    assert (code, errors) == (3, '')
    assert 'kept: 80 messages in all' in output
    assert [line for line in output.splitlines() if line.startswith('lost: ')] != []
    assert 'run_1.mcap' in output


@pytest.mark.parametrize('kind', KINDS)
def test_a_special_file_as_metadata_is_reported(run: Path, tmp_path, kind: str) -> None:
    make(kind, run / 'metadata.yaml')
    code, output, errors = called('recover', run, '-o', tmp_path / 'again')
    assert (code, errors) == (0, '')
    assert 'note: metadata.yaml ' in output
    assert 'kept: 80 messages in all' in output


@pytest.mark.parametrize(
    ('kind', 'option'),
    [*((kind, '--limits') for kind in KINDS), ('pipe', '--geometry'), ('pipe', '')],
)
def test_a_special_file_beside_the_log_is_refused_in_one_line(
    run: Path, tmp_path, kind: str, option: str
) -> None:
    file = tmp_path / 'file.yaml'
    make(kind, file)
    code, output, errors = called('review', run, *filter(None, [option]), file)
    assert (code, output) == (2, '')
    assert errors.startswith(f'review: {file} ')
    assert errors.count('\n') == 1


def record(opcode: int, content: bytes, length: int = 0) -> bytes:
    return struct.pack('<BQ', opcode, length or len(content)) + content


# The length that the first record of a sparse file claims.
REST = SPARSE - 100
HOLLOW = {
    'nothing': b'',
    'message': record(5, struct.pack('<HIQQ', 1, 1, 1, 1), REST),
    'chunk': record(6, struct.pack('<QQQIIQ', 1, 2, 3, 4, 0, REST - 40), REST),
    'attachment': record(9, struct.pack('<QQIIQ', 1, 2, 0, 0, REST - 36), REST),
    'private record': record(0x80, b'', REST),
}


@pytest.mark.parametrize(('name', 'summary'), [*((name, 0) for name in HOLLOW), ('nothing', 1)])
def test_a_sparse_log_costs_only_its_data(tmp_path, name: str, summary: int) -> None:
    """A terabyte that was never written is neither read nor allocated."""
    log = tmp_path / 'log.mcap'
    head = MAGIC + record(1, struct.pack('<I4sI', 4, b'ros2', 0))
    with log.open('wb') as file:
        file.write(head + HOLLOW[name])
        file.truncate(SPARSE)
        file.seek(SPARSE)
        # The summary is all of it, and has a CRC.
        file.write(record(2, struct.pack('<QQI', summary * len(head), 0, summary)) + MAGIC)
    code, output, errors = called('review', log)
    assert (code, errors) == (1, '')
    assert 'ERROR container: the log is damaged: ' in output
    code, _, errors = called('recover', log, '-o', tmp_path / 'again')
    assert code == 2
    assert errors.count('\n') == 1
