"""SQLite files that are truncated, corrupt or hostile: refused in one line, nothing is run."""

from contextlib import closing
import os
import sqlite3

from db3_files import add, begin, make_db3, number
from klann_ros.log.errors import NotALogError
from klann_ros.log.read import sqlite_database
from klann_ros.log.reader import open_log
from klann_ros.log.recover_command import main as recover
from klann_ros.review.command import main as review
import pytest
from rosbag2_bags import read_messages

PAGE = 4096


@pytest.fixture
def bag(tmp_path):
    """Return a file of some hundred pages, each message of which is on one."""
    return make_db3(tmp_path / 'x_0.db3', count=2000, size=150)


def place(page, behind=0):
    """Return where a page is in a file, or what of it is behind its first bytes."""
    return slice((page - 1) * PAGE + behind, page * PAGE)


def read(path):
    """Return the numbers of the messages that are read, and the reported problems."""
    with open_log(path) as log:
        bodies = [m.data[:12] for m in log.messages()]
        assert sorted(bodies) == sorted(
            block.message(row)[:12] for block in log.blocks() for row in range(len(block))
        )
        problems = log.problems
    numbers = {number(n): n for n in range(2000)}
    return [numbers[data] for data in bodies], problems


def test_a_damaged_index_is_not_asked(bag) -> None:
    with closing(sqlite3.connect(bag)) as file:
        query = "SELECT pageno FROM dbstat WHERE name = 'timestamp_idx'"
        pages = [page for (page,) in file.execute(query)]
    data = bytearray(bag.read_bytes())
    for page in pages:
        data[place(page, 8)] = os.urandom(PAGE - 8)
    bag.write_bytes(data)
    assert read(bag) == (list(range(2000)), ())


def _truncate(bag):
    os.truncate(bag, bag.stat().st_size // 2)


def _erase_first_page(bag):
    data = bag.read_bytes()
    bag.write_bytes(bytes(PAGE) + data[PAGE:])


def _leaves(bag):
    with closing(sqlite3.connect(bag)) as file:
        query = (
            "SELECT pageno FROM dbstat WHERE name = 'messages' AND pagetype = 'leaf' ORDER BY path"
        )
        return [page for (page,) in file.execute(query)]


def _overwrite_leaf(bag):
    data = bytearray(bag.read_bytes())
    data[place(_leaves(bag)[10])] = os.urandom(PAGE)
    bag.write_bytes(data)


def _repeat_leaf(bag):
    """Make SQLite itself read the one for the other without an error."""
    data = bytearray(bag.read_bytes())
    leaf_4, leaf_9 = (place(_leaves(bag)[n]) for n in (4, 9))
    data[leaf_9] = data[leaf_4]
    bag.write_bytes(data)


def _rename_table(bag):
    """Make SQLite quote a name that is no UTF-8 in its error message."""
    data = bag.read_bytes().replace(b'CREATE TABLE messages', b'CREATE TABEL messages')
    bag.write_bytes(data.replace(b'tablemessages', b'table\xffessages'))


def _commit_partly(bag):
    """Leave what a kill without a journal on the disk leaves: some pages of a commit."""
    first_size = bag.stat().st_size
    with closing(sqlite3.connect(bag)) as file, file:
        add(file, range(2000, 4000), 150)
    os.truncate(bag, first_size)


@pytest.mark.parametrize(
    'corrupt',
    [_truncate, _erase_first_page, _overwrite_leaf, _repeat_leaf, _rename_table, _commit_partly],
)
@pytest.mark.parametrize('command', [recover, review])
def test_a_file_that_sqlite_refuses_is_refused_with_its_own_recover(
    command, corrupt, bag, capsys
) -> None:
    corrupt(bag)
    assert command([str(bag)]) == 2
    said = capsys.readouterr().err
    assert said.count('\n') == 1
    assert f'sqlite3 {bag} .recover | sqlite3 {bag.parent}/x_0_recovered.db3' in said


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
def test_a_database_that_resembles_a_bag_is_reported_and_not_queried(kind, tmp_path) -> None:
    with closing(sqlite3.connect(tmp_path / 'x.db3')) as file:
        begin(file, 'foxy', STRANGE[kind])
    with pytest.raises(NotALogError, match='it is SQLite, but no bag') as caught:
        open_log(tmp_path / 'x.db3')
    assert '\n' not in str(caught.value)


def test_the_texts_of_a_table_are_bounded(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(sqlite_database, '_MAX_TABLE_SIZE', 100)
    with open_log(make_db3(tmp_path / 'x.db3')) as log:
        assert 'x.db3: there are more than 100 bytes of topics' in log.problems


def test_rows_that_hold_no_message_are_counted(tmp_path, capsys) -> None:
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
    assert 'messages of topic 9, whose description is lost' in said
    messages = read_messages(tmp_path / 'x_recovered')
    assert [data for *_, data in messages] == [b'0001', b'0002', b'0003', b'0004']


def test_hostile_names_are_reported_in_one_line(tmp_path) -> None:
    with closing(sqlite3.connect(tmp_path / 'x.db3')) as file:
        file.execute('CREATE TABLE "a\x1b[31m\n\u202e"(b)')
    with pytest.raises(NotALogError, match='no bag') as caught:
        open_log(tmp_path / 'x.db3')
    assert str(caught.value).isprintable()
