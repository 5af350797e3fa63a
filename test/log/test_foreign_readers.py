"""A recovered run is read completely by the readers that others use."""

import json
import os
from pathlib import Path
import shutil
import struct
import subprocess
import tempfile

from crank_runs import all_but, CHUNK, killed, MESSAGES, spans_of
from klann_ros.log.recovery import recover
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
import pytest
from rosbags.highlevel import AnyReader

HERE = Path(__file__).parent / 'foreign_readers'


def damage(data, kind):
    """Return a damaged file, and the messages that are left."""
    chunks = spans_of(data, CHUNK)
    if kind == 'killed':
        return killed(data), MESSAGES
    if kind == 'cut':
        end = chunks[-1][1] - 10
        return data[:end], all_but(len(chunks) - 1)
    rotten = bytearray(killed(data))
    start, end = chunks[2]
    if kind == 'rotten chunk':
        rotten[(start + end) // 2] ^= 1
    else:
        struct.pack_into('<Q', rotten, start + 1, 2**50)
    return rotten, all_but(2)


@pytest.fixture(params=['killed', 'cut', 'rotten chunk', 'wrong length'])
def recovered(request, run_file, tmp_path):
    """Return a recovered run's folder, and the messages that must be in it."""
    data, kept = damage(run_file.read_bytes(), request.param)
    run_file.write_bytes(data)
    recover(run_file.parent, tmp_path / 'again')
    return tmp_path / 'again', kept


def value(message):
    """Return the number in a Float64."""
    return struct.unpack('<d', message.data[4:])[0]


def test_rosbags_reads_all_of_it(recovered) -> None:
    folder, kept = recovered
    with AnyReader([folder]) as reader:
        found = [
            (time, reader.deserialize(data, connection.msgtype).data)
            for connection, time, data in reader.messages()
        ]
    assert found == [(message.log_time, value(message)) for message in kept]


def test_mcap_ros2_support_reads_all_of_it(recovered) -> None:
    folder, kept = recovered
    with (folder / 'again_0.mcap').open('rb') as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        found = [
            (item.log_time, item.publish_time, item.sequence, decoded.data)
            for _, _, item, decoded in reader.iter_decoded_messages()
        ]
    assert found == [
        (message.log_time, message.publish_time, message.sequence, value(message))
        for message in kept
    ]


@pytest.fixture(scope='session')
def node_reader():
    """Install the readers for node once, into a folder that is kept; return the script there."""
    if shutil.which('node') is None or shutil.which('npm') is None:
        pytest.skip('there is no node with npm on this machine')
    wanted = (HERE / 'package.json').read_bytes()
    folder = Path(tempfile.gettempdir(), f'klann_ros-foreign-readers-{os.getuid()}')
    folder.mkdir(mode=0o700, exist_ok=True)
    if folder.stat().st_uid != os.getuid():
        pytest.skip(f"{folder} is someone else's")
    installed = folder / 'installed.json'
    if not installed.exists() or installed.read_bytes() != wanted:
        (folder / 'package.json').write_bytes(wanted)
        command = [shutil.which('npm'), 'install', '--no-audit', '--no-fund', '--ignore-scripts']
        done = subprocess.run(
            command, cwd=folder, capture_output=True, text=True, timeout=240, check=False
        )
        if done.returncode:
            pytest.skip(f'npm cannot install the readers: {done.stderr.strip()[-200:]}')
        installed.write_bytes(wanted)
    return Path(shutil.copy(HERE / 'read.mjs', folder))


def test_the_readers_of_foxglove_read_all_of_it(recovered, node_reader) -> None:
    folder, kept = recovered
    done = subprocess.run(
        [shutil.which('node'), node_reader, folder / 'again_0.mcap'],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found['topics'] == {'/crank_angle': len(kept)}
    assert found['values'] == [
        [str(message.log_time), message.sequence, value(message)] for message in kept
    ]
    assert found['attachments'] == ['geometry.yaml']
    assert sorted(found['metadata']) == ['rosbag2', 'solver']
