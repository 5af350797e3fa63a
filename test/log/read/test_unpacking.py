"""Packed files and messages: as far as they are whole, bounded, and gone without a trace."""

import os
import resource

from crank_runs import make_messages
from db3_files import make_db3
from klann_ros.log.errors import NotALogError
from klann_ros.log.read import compressed, storage
from klann_ros.log.reader import open_log
from klann_ros.log.recover_command import main as recover
import pytest
from rosbag2_bags import read_messages, write_bag
from rosbags.rosbag2 import CompressionMode, StoragePlugin
import zstandard

MB = 2**20


@pytest.fixture
def file(tmp_path):
    """Return an MCAP file that is not packed, of some megabytes."""
    messages = make_messages(200)
    for message in messages:
        message.data += os.urandom(20_000)
    bag = write_bag(tmp_path / 'bag', messages, StoragePlugin.MCAP, CompressionMode.NONE)
    return bag / 'bag.mcap'


def pack(file, data, **options):
    """Write data packed, beside a file; return the path."""
    path = file.with_name(f'{file.name}.zstd')
    path.write_bytes(zstandard.ZstdCompressor(**options).compress(data))
    return path


@pytest.mark.parametrize('part', [0.2, 0.6, 0.99])
def test_a_truncated_compressed_file_is_read_to_its_end(part, file, capsys) -> None:
    packed = pack(file, file.read_bytes())
    os.truncate(packed, int(part * packed.stat().st_size))
    with open_log(packed) as log:
        count = sum(1 for _ in log.messages())
        assert 'it is cut off: its last zstd frame has no end' in str(log.problems)
    assert count >= 200 * part * 0.8
    assert recover([str(packed)]) == 3
    assert f'kept: {count} messages in all' in capsys.readouterr().out


def test_a_frame_that_rosbag2_left_without_an_end_is_read(file) -> None:
    """One file in 32 is a multiple of its buffer; `zstd -d` refuses it: "premature end"."""
    data = file.read_bytes()
    packer = zstandard.ZstdCompressor().compressobj()
    packed = file.with_name('bag.mcap.zstd')
    packed.write_bytes(packer.compress(data) + packer.flush(zstandard.COMPRESSOBJ_FLUSH_BLOCK))
    with open_log(packed) as log:
        assert sum(1 for _ in log.messages()) == 200
        assert log.problems == (
            'bag.mcap.zstd (unpacked): it is cut off: its last zstd frame has no end',
        )


def test_several_frames_one_behind_the_other_are_one_file(file) -> None:
    data = file.read_bytes()
    first, second = len(data) // 3, len(data) // 2
    parts = data[:first], data[first:second], data[second:]
    packed = file.with_name('bag.mcap.zst')
    packer = zstandard.ZstdCompressor(write_checksum=True)
    # What may be skipped stands between them, such as the index of a seekable file.
    skipped = bytes.fromhex('502a4d18') + (5).to_bytes(4, 'little') + b'index'
    packed.write_bytes(skipped.join(map(packer.compress, parts)) + skipped)
    assert len(read_messages(packed)) == 200


def test_a_corrupt_compressed_file_is_read_up_to_the_damage(file) -> None:
    packed = pack(file, file.read_bytes(), write_checksum=True)
    with packed.open('r+b') as rotten:
        rotten.seek(2 * MB)
        rotten.write(bytes(50))
    with open_log(packed) as log:
        assert sum(1 for _ in log.messages()) >= 200 * 0.4
        assert 'it can be unpacked in part only' in str(log.problems)


def test_a_file_unpacks_to_no_more_than_its_size_allows(file, monkeypatch) -> None:
    monkeypatch.setattr(compressed, 'MIN_FILE_LIMIT', MB)
    monkeypatch.setattr(compressed, 'MAX_FILE_RATIO', 2)
    packed = pack(file, file.read_bytes() + bytes(6 * MB))
    with pytest.raises(NotALogError, match='unpack it by `zstd -d` first') as caught:
        open_log(packed)
    assert '\n' not in str(caught.value)


def test_nothing_is_unpacked_without_disk_space(file, monkeypatch) -> None:
    packed = pack(file, file.read_bytes())
    monkeypatch.setattr(storage, '_MIN_FREE', 2**60)
    with pytest.raises(NotALogError, match='let TMPDIR name a folder with room'):
        open_log(packed)
    bag = make_db3(file.with_name('x.db3'))
    (file.parent / 'x.db3-wal').write_bytes(bytes.fromhex('377f0682') + bytes(100))
    with pytest.raises(NotALogError, match='let TMPDIR name a folder with room'):
        open_log(bag)


def test_a_disk_that_refuses_the_unpacked_file_is_named(file) -> None:
    packed = pack(file, file.read_bytes())
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (MB, limits[1]))
    try:
        with pytest.raises(NotALogError, match='there is no room for it; let TMPDIR'):
            open_log(packed)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


def test_messages_that_cannot_be_unpacked_are_counted_and_the_others_read(
    tmp_path, capsys
) -> None:
    messages = make_messages(100)
    bag = write_bag(tmp_path / 'bag', messages, StoragePlugin.MCAP, CompressionMode.MESSAGE)
    (path,) = bag.glob('*.mcap')
    data = bytearray(path.read_bytes())
    magic = bytes.fromhex('28b52ffd')
    places = [n for n in range(len(data)) if data.startswith(magic, n)]
    assert len(places) == 100
    for place in places[10:13]:
        # A block of a kind that there is not.
        data[place + 6] |= 0b110
    path.write_bytes(data)
    with open_log(bag) as log:
        assert [m.data for m in log.messages()] == [
            m.data for n, m in enumerate(messages) if n not in (10, 11, 12)
        ]
        assert 'messages of /crank_angle cannot be unpacked' in log.problem
        assert sum(map(len, log.blocks())) == 97
    assert recover([str(bag)]) == 3
    assert '3 messages of /crank_angle cannot be unpacked' in capsys.readouterr().out


def test_a_message_is_not_believed_how_large_it_becomes(tmp_path) -> None:
    messages = make_messages(3)
    # A frame of one segment, of 2^40 bytes as it says.
    messages[1].data = bytes.fromhex('28b52ffd') + b'\xe0' + (2**40).to_bytes(8, 'little')
    messages[1].data += b'\1\0\0'
    messages[0].data, messages[2].data = (zstandard.compress(messages[n].data) for n in (0, 2))
    bag = write_bag(tmp_path / 'bag', messages, StoragePlugin.SQLITE3, CompressionMode.NONE)
    with open_log(bag) as log:
        assert sum(1 for _ in log.messages()) == 2
        assert 'refused: 1099512 MB unpacked, above the limit of' in log.problem


def test_only_cdr_messages_are_decompressed(tmp_path) -> None:
    """A camera's own format may be zstd by itself."""
    messages = make_messages(3)
    for message in messages:
        message.data = zstandard.compress(message.data)
    bag = write_bag(tmp_path / 'bag', messages, StoragePlugin.MCAP, CompressionMode.NONE)
    (path,) = bag.glob('*.mcap')
    path.write_bytes(path.read_bytes().replace(b'\3\0\0\0cdr', b'\3\0\0\0raw'))
    with open_log(bag) as log:
        assert [m.data for m in log.messages()] == [m.data for m in messages]
