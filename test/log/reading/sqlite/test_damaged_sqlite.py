"""Files of SQLite that are cut off, rotten or hostile: what is intact is read, nothing is run."""

from collections import Counter
from contextlib import closing, redirect_stderr, redirect_stdout
import io
import os
from pathlib import Path
import random
import re
import sqlite3
from types import ModuleType

from db3_files import begin, make_db3, number, START
from fuzzing.damages import damage
from klann_ros.log.errors import NotALogError
from klann_ros.log.reader import open_log
from klann_ros.log.recover_command import main as recover
from klann_ros.review.command import main as review
import pytest
from rosbag2_bags import digest, told, write_bag
from rosbags.rosbag2 import CompressionMode, StoragePlugin

PAGE = 4096


@pytest.fixture
def bag(tmp_path: Path):
    """Return a file of some hundred pages, each message of which is on one."""
    return make_db3(tmp_path / 'x_0.db3', count=2000, size=150)


def place(page, behind=0):
    """Return where a page is in a file, or what of it is behind its first bytes."""
    return slice((page - 1) * PAGE + behind, page * PAGE)


def read(path):
    """Return the numbers of the messages that are read, and what is said to be wrong."""
    with open_log(path) as log:
        found = [m.data[:12] for m in log.messages()]
        assert sorted(found) == sorted(
            block.message(row)[:12] for block in log.blocks() for row in range(len(block))
        )
        problems = log.problems
    numbers = {number(n): n for n in range(2000)}
    return [numbers[data] for data in found], problems


@pytest.mark.parametrize('part', [0.2, 0.5, 0.9, 0.99])
def test_of_a_file_that_is_cut_off_all_that_is_there_is_read(
    part, bag, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of such a file SQLite reads nothing."""
    with closing(sqlite3.connect(bag)) as file:
        query = "SELECT pageno, ncell FROM dbstat WHERE name = 'messages' AND pagetype = 'leaf'"
        leaves = file.execute(query).fetchall()
    size = int(part * bag.stat().st_size)
    os.truncate(bag, size)
    found, problems = read(bag)
    whole = sum(count for page, count in leaves if page * PAGE <= size)
    assert whole <= len(found) <= whole + max(count for _, count in leaves)
    assert re.search('it is cut off: [0-9]+ of its [0-9]+ pages are missing', str(problems))
    assert recover([str(bag)]) == 3
    said = capsys.readouterr().out
    assert 'malformed; its pages were gone through one by one' in said
    assert f'kept: {len(found)} messages in all' in said
    assert len(told(bag.with_name('x_0_recovered'))) == len(found)


def test_what_is_missing_in_the_middle_is_counted_and_a_hole(bag) -> None:
    with closing(sqlite3.connect(bag)) as file:
        query = "SELECT pageno FROM dbstat WHERE name = 'messages' AND pagetype = 'leaf'"
        leaves = [page for (page,) in file.execute(query)]
    data = bytearray(bag.read_bytes())
    for page in leaves[10:13]:
        data[place(page)] = os.urandom(PAGE)
    bag.write_bytes(data)
    with open_log(bag) as log:
        numbers = [(m.log_time - START) // 10**6 for m in log.messages()]
        lost = sorted(set(range(2000)) - set(numbers))
        assert 0 < len(lost) == lost[-1] - lost[0] + 1 < 80
        said = f'{len(lost)} messages are missing by the numbers, the first behind number'
        assert f'{said} {lost[0]}' in str(log.problems)
        times = [(START + n * 10**6) for n in (lost[0] - 1, lost[-1] + 1)]
        assert log.holes == (tuple(times),)


def test_a_damaged_first_page_costs_nothing_but_itself(bag) -> None:
    data = bag.read_bytes()
    bag.write_bytes(bytes(PAGE) + data[PAGE:])
    found, problems = read(bag)
    assert found == list(range(2000))
    assert 'its first bytes are not those of SQLite' in str(problems)


def test_messages_larger_than_pages_are_put_together_without_sqlite(
    tmp_path: Path, runs: ModuleType
) -> None:
    messages = runs.make_messages(30)
    for n, message in enumerate(messages):
        message.data += random.Random(n).randbytes(1500 * n)  # noqa: S311 - no secret
    bag = write_bag(tmp_path / 'x', messages, StoragePlugin.SQLITE3, CompressionMode.NONE)
    path = bag / 'x.db3'
    wanted = told(bag)
    path.write_bytes(bytes(16) + path.read_bytes()[16:])
    with open_log(path) as log:
        assert [m.data for m in log.messages()] == [data for *_, data in wanted]


def test_a_damaged_index_is_not_asked(bag) -> None:
    with closing(sqlite3.connect(bag)) as file:
        query = "SELECT pageno FROM dbstat WHERE name = 'timestamp_idx'"
        pages = [page for (page,) in file.execute(query)]
    data = bytearray(bag.read_bytes())
    for page in pages:
        data[place(page, 8)] = os.urandom(PAGE - 8)
    bag.write_bytes(data)
    assert read(bag) == (list(range(2000)), ())


def test_a_page_that_stands_twice_in_a_table_does_not_count_twice(bag) -> None:
    """The one is read for the other without a word by SQLite itself."""
    with closing(sqlite3.connect(bag)) as file:
        query = (
            "SELECT pageno FROM dbstat WHERE name = 'messages' AND pagetype = 'leaf' ORDER BY path"
        )
        leaves = [page for (page,) in file.execute(query)]
    data = bytearray(bag.read_bytes())
    one, other = (place(leaves[n]) for n in (4, 9))
    data[other] = data[one]
    bag.write_bytes(data)
    found, problems = read(bag)
    assert found == sorted(set(found))
    assert len(found) < 2000
    assert 'its rows are out of order; its pages were gone through' in str(problems)


STRANGE = {
    'view': "CREATE VIEW messages AS SELECT 1 id, 1 topic_id, 5 timestamp, x'00' data",
    'endless view': """CREATE VIEW messages AS
        WITH RECURSIVE c(n) AS (SELECT 1 UNION ALL SELECT n + 1 FROM c)
        SELECT n id, 1 topic_id, n timestamp, x'00' data FROM c""",
    'virtual': 'CREATE VIRTUAL TABLE messages USING fts4(id, topic_id, timestamp, data)',
    'computed': """CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id, timestamp,
        data BLOB GENERATED ALWAYS AS (zeroblob(1000000000)) VIRTUAL);
        INSERT INTO messages(topic_id, timestamp) VALUES (1, 5)""",
    'without numbers': 'CREATE TABLE messages(id TEXT PRIMARY KEY, topic_id, timestamp, data)',
    'without columns': 'CREATE TABLE messages(id INTEGER PRIMARY KEY, name TEXT)',
    'of a browser': 'CREATE TABLE moz_places(id INTEGER PRIMARY KEY)',
}


@pytest.mark.parametrize('kind', STRANGE)
def test_what_only_looks_like_a_bag_is_told_and_not_asked(kind, tmp_path: Path) -> None:
    with closing(sqlite3.connect(tmp_path / 'x.db3')) as file:
        begin(file, 'foxy', STRANGE[kind])
    with pytest.raises(NotALogError, match='it is SQLite, but no bag') as caught:
        open_log(tmp_path / 'x.db3')
    assert '\n' not in str(caught.value)


def test_rows_that_hold_no_message_are_counted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with closing(sqlite3.connect(tmp_path / 'x.db3')) as file:
        begin(file)
        rows = [(1, 1, b'0001'), (1, 2, 'text'), ('x', 3, b'0'), (1, 'x', b'0'), (1, -7, b'0')]
        rows += [(1, 1.5, b'0'), (9, 4, b'0'), (1, 5, b'0002')]
        file.executemany('INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)', rows)
        ends = [(-(2**63), 1, 6, b'0003'), (2**63 - 1, 1, 7, b'0004')]
        file.executemany('INSERT INTO messages VALUES (?, ?, ?, ?)', ends)
        file.commit()
    assert recover([str(tmp_path / 'x.db3')]) == 3
    said = capsys.readouterr().out
    assert '5 rows of its table of messages hold no message' in said
    assert '1 message of topics whose description is lost' in said
    found = told(tmp_path / 'x_recovered')
    assert [data for *_, data in found] == [b'0001', b'0002', b'0003', b'0004']


def test_names_of_strangers_are_told_in_one_line(tmp_path: Path) -> None:
    with closing(sqlite3.connect(tmp_path / 'x.db3')) as file:
        file.execute('CREATE TABLE "a\x1b[31m\n\u202e"(b)')
    with pytest.raises(NotALogError, match='no bag') as caught:
        open_log(tmp_path / 'x.db3')
    assert str(caught.value).isprintable()


def test_a_sparse_file_takes_no_longer_than_what_is_in_it(bag) -> None:
    os.truncate(bag, 2**40)
    assert read(bag)[0] == list(range(2000))
    with bag.open('r+b') as file:
        file.write(bytes(16))
    assert read(bag)[0] == list(range(2000))


@pytest.fixture(scope='module')
def samples(tmp_path_factory: pytest.TempPathFactory, runs: ModuleType):
    """Return bags of SQLite, plain and packed, small, with what is in them."""
    place = tmp_path_factory.mktemp('samples')
    messages = sorted(
        [*runs.make_messages(300), *runs.make_messages(60, '/point_h', 5_000_000)],
        key=lambda message: message.log_time,
    )
    for n, message in enumerate(messages[::40]):
        message.data += bytes(900 * n)
    modes = (CompressionMode.NONE, CompressionMode.MESSAGE, CompressionMode.FILE)
    bags = [write_bag(place / m.name, messages, StoragePlugin.SQLITE3, m) for m in modes]
    return bags, Counter(told(bags[0]))


def run(main, *arguments):
    said = io.StringIO()
    with redirect_stdout(said), redirect_stderr(said):
        code = main([str(argument) for argument in arguments])
    return code, said.getvalue()


@pytest.mark.parametrize('seed', range(30))
def test_any_damage_is_told_and_costs_no_more_than_it_hits(seed, samples, tmp_path: Path) -> None:
    bags, wanted = samples
    source = bags[seed % 3]
    bag = tmp_path / 'bag'
    bag.mkdir()
    (file,) = (path for path in source.iterdir() if path.name != 'metadata.yaml')
    path = bag / file.name
    path.write_bytes(file.read_bytes())
    story, _ = damage(path, random.Random(seed))  # noqa: S311 - no secret
    before = digest(bag)
    code, said = run(recover, bag, '-o', tmp_path / 'run')
    assert code in (0, 2, 3), said
    assert (code == 3) == ('lost: ' in said)
    if code == 2:
        assert said.count('\n') == 1
    else:
        found = Counter(told(tmp_path / 'run'))
        # SQLite has no CRC: what is changed cannot be told, what is missing is.
        assert code == 3 or found.total() >= wanted.total(), f'{story}: {said}'
    code, _ = run(review, bag)
    assert code in (0, 1, 2)
    assert digest(bag) == before


def test_a_damaged_bag_of_a_page_size_of_its_own_is_read(tmp_path: Path) -> None:
    for page in (512, 65536):
        path = tmp_path / f'{page}.db3'
        with closing(sqlite3.connect(path)) as file, file:
            file.execute(f'PRAGMA page_size = {page}')
            begin(file)
            rows = [(START + n, number(n) + bytes(100 * n)) for n in range(200)]
            query = 'INSERT INTO messages(topic_id, timestamp, data) VALUES (1, ?, ?)'
            file.executemany(query, rows)
        wanted = [data for *_, data in told(path)]
        os.truncate(path, path.stat().st_size - page)
        with open_log(path) as log:
            assert 'its pages were gone through' in log.problem
            found = [message.data for message in log.messages()]
        assert found == wanted[: len(found)]
        assert len(found) >= 190
