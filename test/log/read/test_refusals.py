"""What is no log is refused in one line, which names its kind and the remedy."""

import os
import shlex

from klann_ros.log.errors import NotALogError
from klann_ros.log.reader import open_log
from mcap.writer import MCAP0_MAGIC
import pytest
import yaml
import zstandard

REST = bytes(600)
SQLITE = r"it should be SQLite, rosbag2's \.db3, "
# By name: the content, None for no file, and the reason.
FILES = {
    'no path.mcap': (None, 'there is no such path'),
    'empty.mcap': (b'', 'the file is empty'),
    'a part of the magic.mcap': (MCAP0_MAGIC[:5], 'it does not start as an MCAP file does'),
    'the magic.mcap': (MCAP0_MAGIC, 'there is no header'),
    'the magic twice.mcap': (MCAP0_MAGIC * 2, 'there is no header'),
    'sqlite.mcap': (b'SQLite format 3\0' * 10, f'{SQLITE}but'),
    'empty.db3': (b'', f'{SQLITE}and is empty'),
    'zeros.db3': (bytes(8192), f'{SQLITE}but'),
    'zeros.mcap.zstd': (REST, 'it should be a zstd file'),
    'packed nothing.mcap.zstd': (zstandard.compress(b''), 'it is a zstd file, but'),
    'packed text.mcap.zstd': (zstandard.compress(b'no log' * 20), 'neither MCAP nor SQLite'),
    'a.bag': (b'#ROSBAG V2.0\n' + REST, 'it is a ROS 1 bag; `rosbags-convert --src'),
    'a.pcap': (b'\xd4\xc3\xb2\xa1' + REST, 'it is a pcap capture'),
    'a.pcapng': (b'\x0a\x0d\x0d\x0a' + REST, 'it is a pcapng capture'),
    'a.mcap': (b'version https://git-lfs.github.com/spec/v1\n', '`git lfs pull` fetches the file'),
    'a.ulg': (b'ULog\x01\x12\x35' + REST, 'it is a ULog of PX4'),
    'a.gz': (b'\x1f\x8b\x08' + REST, 'it is a gzip file; unpack it first'),
    'a.zip': (b'PK\x03\x04' + REST, 'it is a zip file; unpack it first'),
    'a.tar': (bytes(257) + b'ustar\x0000' + REST, 'it is a tar archive; unpack it first'),
    'a.csv': ('Größe,alpha\n0.0,1.0\n'.encode() * 100, 'it is text'),
    'metadata.yaml': (b'rosbag2_bagfile_information: {}', 'give the folder, '),
}


@pytest.mark.parametrize('name', FILES)
def test_a_non_log_file_is_refused_with_its_kind(tmp_path, name) -> None:
    path = tmp_path / f"somebody's {name}" if name != 'metadata.yaml' else tmp_path / name
    content, reason = FILES[name]
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(NotALogError, match=reason) as caught:
        open_log(path)
    assert str(path) in str(caught.value)
    assert '\n' not in str(caught.value)


def test_folders_pipes_and_devices_are_refused(tmp_path) -> None:
    with pytest.raises(NotALogError, match=r'no \.mcap or \.db3 file in the folder'):
        open_log(tmp_path)
    os.mkfifo(tmp_path / 'pipe')
    for path in ('/dev/zero', tmp_path / 'pipe'):
        with pytest.raises(NotALogError, match='not a regular file'):
            open_log(path)


def command(path):
    """Return the words of the command in a refusal, as a shell takes them."""
    with pytest.raises(NotALogError) as caught:
        open_log(path)
    return shlex.split(str(caught.value).split('`')[1])


def test_the_command_for_a_ros_1_bag_is_one_that_a_shell_takes(tmp_path) -> None:
    path = tmp_path / "a b's.bag"
    path.write_bytes(b'#ROSBAG V2.0\n')
    source = ['--src', str(path), '--dst', str(path.with_suffix(''))]
    assert command(path) == ['rosbags-convert', *source, '--dst-storage', 'mcap']


@pytest.mark.parametrize(
    'said',
    [
        {'storage_identifier': "my plugin's", 'relative_file_paths': ['x_0.mine']},
        {
            'storage_identifier': 'sqlite3',
            'relative_file_paths': ['x_0.db3'],
            'compression_mode': 'MESSAGE',
            'compression_format': 'lz4',
        },
    ],
)
def test_a_storage_that_only_rosbag2_reads_is_refused_with_its_command(said, tmp_path) -> None:
    bag = tmp_path / "somebody's bag"
    bag.mkdir()
    (bag / said['relative_file_paths'][0]).write_bytes(b'anything')
    (bag / 'metadata.yaml').write_text(yaml.safe_dump({'rosbag2_bagfile_information': said}))
    echo, options, *words = command(bag)
    assert (echo, words[:3]) == ('echo', ['>', 'to.yaml', '&&'])
    assert words[3:] == ['ros2', 'bag', 'convert', '-i', str(bag), '-o', 'to.yaml']
    (output,) = yaml.safe_load(options)['output_bags']
    assert output == {'uri': f'{bag}_mcap', 'storage_id': 'mcap', 'all': True}
