"""What a recorder that was killed has left in SQLite files, and beside them, is read."""

from contextlib import closing
from pathlib import Path
import shutil
import sqlite3
import struct
import subprocess
import sys

import db3_files
from db3_files import add, begin, make_db3, number, START
from klann_ros.log.errors import NotALogError
from klann_ros.log.reader import open_log
from klann_ros.log.recover_command import main as recover
import pytest
from rosbag2_bags import digest, read_messages

# Writes messages in transactions of a size until it is killed, and prints their number so far.
WRITER = """
import itertools, sqlite3, sys
sys.path.insert(0, sys.argv[4])
from db3_files import add, begin
path, mode, batch = sys.argv[1], sys.argv[2], int(sys.argv[3])
bag = sqlite3.connect(path, isolation_level=None)
for setting in (f'journal_mode = {mode}', 'synchronous = OFF', 'cache_size = 20'):
    bag.execute(f'PRAGMA {setting}')
begin(bag)
for first in itertools.count(0, 100):
    if first % batch == 0:
        bag.execute('BEGIN')
    add(bag, range(first, first + 100), 200)
    if (first + 100) % batch == 0:
        bag.execute('COMMIT')
    print(first + 100, flush=True)
"""
# SQLite keeps what was written last to itself: a few pages.
CACHE = 800
COMMITTED, NOT_AT_ALL = 100, 10**9


def kill_a_writer(bag, mode, batch, count=3000):
    """Let a process write a number of messages to a bag, and kill it."""
    bag.mkdir()
    folder = str(Path(db3_files.__file__).parent)
    command = [sys.executable, '-c', WRITER, str(bag / 'x_0.db3'), mode, str(batch), folder]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        for line in process.stdout:
            if int(line) >= count:
                break
        process.kill()
    return bag


@pytest.mark.parametrize('mode', ['WAL', 'DELETE'])
def test_all_that_a_killed_recorder_committed_is_read(mode, tmp_path, capsys) -> None:
    bag = kill_a_writer(tmp_path / 'bag', mode, COMMITTED)
    first_digest = digest(bag)
    with open_log(bag) as log:
        messages = list(log.messages())
    assert len(messages) >= 3000 - CACHE
    assert [m.data[:12] for m in messages] == [number(n) for n in range(len(messages))]
    assert recover([str(bag), '-o', str(tmp_path / 'run')]) == 0, capsys.readouterr()
    assert len(read_messages(tmp_path / 'run')) == len(messages)
    assert digest(bag) == first_digest


def test_pages_that_were_not_committed_are_reported(tmp_path) -> None:
    """Without a journal on the disk SQLite takes them back without a word."""
    path = make_db3(tmp_path / 'x_0.db3', count=1000)
    with path.open('ab') as file:
        file.write(bytes(3 * 4096))
    with open_log(path) as log:
        assert len(list(log.messages())) == 1000
        assert '3 pages behind its last commit are left out' in log.problem


def test_a_missing_write_ahead_log_is_reported(tmp_path) -> None:
    bag = kill_a_writer(tmp_path / 'bag', 'WAL', NOT_AT_ALL, 1000)
    shutil.copy(bag / 'x_0.db3', tmp_path / 'x_0.db3')
    with pytest.raises(NotALogError, match=r'no table in it.*x_0\.db3-wal, which belongs beside'):
        open_log(tmp_path / 'x_0.db3')


def test_a_finished_journal_is_not_taken_for_a_kill(tmp_path) -> None:
    with closing(sqlite3.connect(tmp_path / 'x.db3', isolation_level=None)) as bag:
        bag.execute('PRAGMA journal_mode = PERSIST')
        begin(bag)
        add(bag, range(10))
    assert (tmp_path / 'x.db3-journal').stat().st_size
    assert len(read_messages(tmp_path / 'x.db3')) == 10


def test_a_journal_cannot_have_a_file_deleted(tmp_path) -> None:
    """What a journal of several files names is deleted by SQLite, once it is rolled back."""
    bag = kill_a_writer(tmp_path / 'bag', 'DELETE', NOT_AT_ALL)
    victim = tmp_path / 'precious'
    victim.write_bytes(b'nothing of SQLite')
    name = str(victim).encode()
    end = struct.pack('>II', len(name), sum(name)) + bytes.fromhex('d9d505f920a163d7')
    with (bag / 'x_0.db3-journal').open('ab') as journal:
        journal.write(struct.pack('>I', 2**32 // 65536) + name + end)
    with open_log(bag) as log:
        assert 'x_0.db3-journal is beside it' in log.problem
    assert victim.exists()


def _wal(page_size, frames):
    """Return a write-ahead log of pages: number, size of the file after its commit, content."""
    head = struct.pack('>IIIIII', 0x377F0683, 3007000, page_size, 0, 1, 2)
    s0, s1 = _sum(head, 0, 0)
    data = head + struct.pack('>II', s0, s1)
    for page, size, content in frames:
        s0, s1 = _sum(struct.pack('>II', page, size), s0, s1)
        s0, s1 = _sum(content, s0, s1)
        data += struct.pack('>IIIIII', page, size, 1, 2, s0, s1) + content
    return data


def _sum(data, s0, s1):
    for a, b in struct.iter_unpack('>II', data):
        s0 = (s0 + a + s1) & 0xFFFFFFFF
        s1 = (s1 + b + s0) & 0xFFFFFFFF
    return s0, s1


def test_a_log_that_claims_a_huge_file_is_of_no_use(tmp_path) -> None:
    bag = make_db3(tmp_path / 'x.db3')
    frame = (2**31, 2**31, bytes(4096))
    (tmp_path / 'x.db3-wal').write_bytes(_wal(4096, [frame]))
    with open_log(bag) as log:
        assert sum(1 for _ in log.messages()) == 100
        assert 'x.db3-wal beside it is of no use' in log.problem


@pytest.mark.parametrize('content', [b'', b'\x37\x7f\x06\x82' + bytes(100), b'nothing' * 100])
@pytest.mark.parametrize('suffix', ['-wal', '-journal'])
def test_anything_may_lie_beside_a_file(content, suffix, tmp_path) -> None:
    bag = make_db3(tmp_path / 'x.db3')
    (tmp_path / f'x.db3{suffix}').write_bytes(content)
    with open_log(bag) as log:
        assert [m.log_time for m in log.messages()] == [START + n * 10**6 for n in range(100)]
