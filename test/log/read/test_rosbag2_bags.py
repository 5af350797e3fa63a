"""What rosbag2 writes beside plain MCAP is read message by message as rosbags reads it."""

from contextlib import closing
import random
import sqlite3

from crank_runs import make_messages
from db3_files import add, begin, FLOAT, HASH, make_db3, number, START, TABLES
from klann_ros.log.definitions import definition
from klann_ros.log.qos import latched_count, qos_from_yaml
from klann_ros.log.reader import open_log
from klann_ros.log.recover_command import main as recover
import pytest
from rosbag2_bags import digest, KINDS, LATCHED, NAMES, read_by_rosbags, read_messages, write_bag
from rosbags.rosbag2 import CompressionMode, StoragePlugin


@pytest.fixture(scope='module', params=KINDS, ids=NAMES)
def bag(request, tmp_path_factory, sent):
    return write_bag(tmp_path_factory.mktemp('bags') / 'bag', sent, *request.param)


@pytest.fixture(scope='module')
def sent():
    """Messages of two topics, some as large as several pages."""
    large = make_messages(40, '/large', 25_000_000)
    for n, message in enumerate(large):
        message.data += bytes([n]) * (n * 1000)
    messages = [*make_messages(1000), *large]
    return sorted(messages, key=lambda message: message.log_time)


def test_a_bag_is_read_as_rosbags_reads_it(bag) -> None:
    messages = read_messages(bag)
    assert sorted(messages) == sorted(read_by_rosbags(bag))
    times = [time for _, _, time, _ in messages]
    assert times == sorted(times)


def test_topic_metadata_of_a_bag_are_kept(bag) -> None:
    with open_log(bag) as log:
        topics = log.topics
    assert [(topic.name, topic.type) for topic in topics] == [
        ('/crank_angle', FLOAT),
        ('/large', FLOAT),
    ]
    for topic in topics:
        assert topic.definition == definition(FLOAT)
        assert (topic.message_encoding, topic.schema_encoding) == ('cdr', 'ros2msg')
        assert latched_count(qos_from_yaml(topic.qos)) == LATCHED.depth


def test_a_part_of_a_bag_is_read(bag, sent) -> None:
    start, end = sent[200].log_time, sent[300].log_time
    written = [m.data for m in sent if start <= m.log_time <= end and m.topic.name == '/large']
    with open_log(bag) as log:
        assert [m.data for m in log.messages(['/large'], start=start, end=end)] == written
        assert [m.data for m in log.latest({'/large': 2}, start)] == [
            m.data for m in sent if m.topic.name == '/large' and m.log_time < start
        ][-2:]


def test_a_bag_is_recovered_to_a_run_that_has_all_of_it(bag, tmp_path, capsys) -> None:
    first_digest = digest(bag)
    assert recover([str(bag), '-o', str(tmp_path / 'run')]) == 0
    assert f'kept: {len(read_messages(bag))} messages in all' in capsys.readouterr().out
    assert read_messages(tmp_path / 'run') == read_messages(bag)
    assert digest(bag) == first_digest
    with open_log(bag) as log, open_log(tmp_path / 'run') as run:
        assert [t.definition for t in run.topics] == [t.definition for t in log.topics]


def test_a_file_of_a_bag_is_read_by_itself(bag) -> None:
    """Its content shows that its messages are compressed: no metadata.yaml is needed."""
    (path,) = (path for path in bag.iterdir() if path.name != 'metadata.yaml')
    assert read_messages(path) == read_messages(bag)


@pytest.mark.parametrize('age', TABLES)
def test_an_sqlite_file_of_any_age_is_read(age, tmp_path) -> None:
    bag = make_db3(tmp_path / 'old_0.db3', age)
    assert read_messages(bag) == [
        ('/number', FLOAT, START + n * 10**6, number(n)) for n in range(100)
    ]
    with open_log(bag) as log:
        (topic,) = log.topics
    # Bags before Iron have no definitions: the installed ones are taken.
    assert topic.definition == definition(FLOAT)
    assert topic.type_hash == (HASH if age == 'jazzy' else '')


def test_a_recovery_reports_the_source_of_its_definitions(tmp_path, capsys) -> None:
    bag = make_db3(tmp_path / 'old_0.db3', 'foxy')
    assert recover([str(bag)]) == 0
    assert f'definitions of {FLOAT} are those installed here' in capsys.readouterr().out
    with open_log(tmp_path / 'old_0_recovered') as run:
        assert run.topics[0].definition == definition(FLOAT)


def test_rows_that_stand_out_of_order_come_in_order(tmp_path) -> None:
    shuffled = random.Random(3).sample(range(5000), 5000)  # noqa: S311 - no secret
    with closing(sqlite3.connect(tmp_path / 'x.db3')) as bag, bag:
        begin(bag)
        for n in shuffled:
            add(bag, range(n, n + 1))
    assert [time for _, _, time, _ in read_messages(tmp_path / 'x.db3')] == [
        START + n * 10**6 for n in range(5000)
    ]


def test_a_bag_whose_messages_were_deleted_in_part_is_whole(tmp_path) -> None:
    """Some people take a topic out of a bag like that."""
    bag = make_db3(tmp_path / 'x.db3', count=5000)
    with closing(sqlite3.connect(bag)) as file, file:
        file.execute('DELETE FROM messages WHERE id % 3')
    assert len(read_messages(bag)) == 5000 // 3


def test_an_empty_bag_has_its_topics(tmp_path) -> None:
    with open_log(make_db3(tmp_path / 'x.db3', count=0)) as log:
        assert [topic.name for topic in log.topics] == ['/number']
        assert (list(log.messages()), list(log.blocks())) == ([], [])
        assert log.complete


def test_rosbag2_metadata_are_read(tmp_path, sent) -> None:
    bag = write_bag(tmp_path / 'bag', sent, StoragePlugin.SQLITE3, CompressionMode.NONE)
    with open_log(bag) as log:
        (record,) = log.metadata['rosbag2']
    assert 'storage_identifier: sqlite3' in record['serialized_metadata']


@pytest.mark.parametrize('is_closed', [True, False])
def test_nothing_that_was_unpacked_is_left(sent, tmp_path, monkeypatch, is_closed) -> None:
    bag = write_bag(tmp_path / 'bag', sent, StoragePlugin.MCAP, CompressionMode.FILE)
    monkeypatch.setattr('tempfile.tempdir', str(tmp_path))
    log = open_log(bag)
    assert len(list(tmp_path.iterdir())) == 2
    assert len(list(log.messages())) == len(sent)
    if is_closed:
        log.close()
    else:
        del log
    assert list(tmp_path.iterdir()) == [bag]
