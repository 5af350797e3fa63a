"""The files of a bag in a folder."""

import os
import shutil
import subprocess
import sys

from crank_runs import make_messages
from db3_files import make_db3
from klann_ros.log.reader import open_log
from klann_ros.log.recover_command import default_output
import pytest
from rosbag2_bags import MODES, read_messages, write_bag
from rosbags.rosbag2 import CompressionMode, StoragePlugin
import yaml
import zstandard


@pytest.fixture
def messages():
    return make_messages(50)


@pytest.mark.parametrize('with_metadata', [True, False])
def test_a_split_bag_of_sqlite_is_one_log(with_metadata, tmp_path) -> None:
    names = ['x_0.db3', 'x_2.db3', 'x_10.db3']
    for name in names:
        make_db3(tmp_path / name)
    if with_metadata:
        root = {'rosbag2_bagfile_information': {'relative_file_paths': names[:2]}}
        (tmp_path / 'metadata.yaml').write_text(yaml.safe_dump(root))
    with open_log(tmp_path) as log:
        assert [path.name for path in log.paths] == names
        assert sum(1 for _ in log.messages()) == 300
    said = 'x_10.db3 is not named in metadata.yaml; it continues the run, and is read'
    assert log.problems == ((said,) if with_metadata else ())


@pytest.mark.parametrize('storage', StoragePlugin)
@pytest.mark.parametrize('mode', MODES)
def test_a_bag_without_metadata_is_whole(storage, mode, messages, tmp_path) -> None:
    bag = write_bag(tmp_path / 'bag', messages, storage, mode)
    wanted = read_messages(bag)
    (bag / 'metadata.yaml').unlink()
    assert read_messages(bag) == wanted


def test_of_two_storages_one_is_the_bag(messages, tmp_path) -> None:
    """Somebody has converted it to where it was; each message counts once."""
    bag = write_bag(tmp_path / 'x', messages, StoragePlugin.MCAP, CompressionMode.NONE)
    (bag / 'metadata.yaml').unlink()
    make_db3(bag / 'x_0.db3')
    with open_log(bag) as log:
        assert [path.name for path in log.paths] == ['x.mcap']
        assert 'x_0.db3 is left out: x.mcap beside it is of another storage' in log.problem


def test_with_two_storages_the_metadata_decides(messages, tmp_path) -> None:
    bag = write_bag(tmp_path / 'x', messages, StoragePlugin.SQLITE3, CompressionMode.NONE)
    shutil.copy(bag / 'x.db3', tmp_path / 'kept.db3')
    (bag / 'x_0.mcap').write_bytes(b'')
    with open_log(bag) as log:
        assert [path.name for path in log.paths] == ['x.db3']
        assert log.problems == ('x_0.mcap is not named in metadata.yaml, and is left out',)


@pytest.fixture
def packed(messages, tmp_path):
    """Return a bag whose file is packed, and the same file unpacked."""
    bag = write_bag(tmp_path / 'x', messages, StoragePlugin.MCAP, CompressionMode.FILE)
    unpacked = (
        zstandard.ZstdDecompressor().stream_reader((bag / 'x.mcap.zstd').read_bytes()).read()
    )
    return bag, unpacked


@pytest.mark.parametrize('kept', [True, False])
def test_an_unpacked_file_is_not_read_twice(packed, kept) -> None:
    """`ros2 bag play` leaves the unpacked file beside the packed one."""
    bag, unpacked = packed
    messages = read_messages(bag)
    (bag / 'x.mcap').write_bytes(unpacked)
    if not kept:
        (bag / 'x.mcap.zstd').unlink()
    assert read_messages(bag) == messages
    with open_log(bag) as log:
        assert [path.name for path in log.paths] == ['x.mcap']


@pytest.mark.parametrize('part', [0, 8, 500, 1200])
def test_a_partly_decompressed_file_is_read_from_the_compressed_one(part, packed) -> None:
    bag, unpacked = packed
    messages = read_messages(bag)
    (bag / 'x.mcap').write_bytes(unpacked[:part])
    assert read_messages(bag) == messages


@pytest.mark.parametrize('suffix', ['.zstd', '.zst'])
def test_a_file_that_was_packed_since_is_found(suffix, messages, tmp_path) -> None:
    bag = write_bag(tmp_path / 'x', messages, StoragePlugin.SQLITE3, CompressionMode.NONE)
    wanted = read_messages(bag)
    (bag / f'x.db3{suffix}').write_bytes(zstandard.compress((bag / 'x.db3').read_bytes()))
    (bag / 'x.db3').unlink()
    assert read_messages(bag) == wanted


def test_a_damaged_mcap_file_that_begins_as_something_else_is_read(messages, tmp_path) -> None:
    bag = write_bag(tmp_path / 'x', messages, StoragePlugin.MCAP, CompressionMode.NONE)
    path = bag / 'x.mcap'
    path.write_bytes(b'\x1f\x8b' + path.read_bytes()[2:])
    with open_log(path) as log:
        assert len(list(log.messages())) == len(messages)


@pytest.mark.parametrize(
    'name', ['walk_0.mcap', 'walk_0.db3', 'walk_0.mcap.zstd', 'walk_0.db3.zst', 'walk_0']
)
def test_a_file_is_recovered_to_a_run_of_its_name(name, tmp_path) -> None:
    assert default_output(tmp_path / name) == tmp_path / 'walk_0_recovered'


WITHOUT_SQLITE = """
import sys
sys.modules['_sqlite3'] = None
from klann_ros.log.recover_command import main
print([main([bag, '-o', f'{bag}_out']) for bag in sys.argv[1:]])
"""


def test_a_python_without_sqlite_reads_all_else(messages, tmp_path) -> None:
    bags = [
        write_bag(tmp_path / storage.name, messages, storage, CompressionMode.NONE)
        for storage in StoragePlugin
    ]
    result = subprocess.run(
        [sys.executable, '-c', WITHOUT_SQLITE, *map(str, bags)],
        env={**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.stdout.splitlines()[-1] == '[2, 0]'
    assert "it is SQLite, rosbag2's .db3, which this Python was built without" in result.stderr
    assert result.stderr.count('\n') == 1
