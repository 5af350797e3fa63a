"""A recovered run is read completely by the readers of Foxglove; see `test_write_read`, too."""

import json
import os
from pathlib import Path
import shutil
import struct
import subprocess
import tempfile

from crank_runs import all_but, CHUNK, killed, spans_of
from klann_ros.log.recovery import recover
import pytest

HERE = Path(__file__).parent / 'foreign_readers'


@pytest.fixture
def recovered(run_file, tmp_path):
    """Recover a run with a rotten chunk and no end; return its folder, and what must be in it."""
    data = run_file.read_bytes()
    start, end = spans_of(data, CHUNK)[2]
    rotten = bytearray(killed(data))
    rotten[(start + end) // 2] ^= 1
    run_file.write_bytes(rotten)
    recover(run_file.parent, tmp_path / 'again')
    return tmp_path / 'again', all_but(2)


@pytest.fixture(scope='session')
def node_reader():
    """Install the readers for node once, into a folder that is kept; return the script there."""
    if shutil.which('node') is None or shutil.which('npm') is None:
        pytest.skip('there is no node with npm on this machine')
    package = (HERE / 'package.json').read_bytes()
    folder = Path(tempfile.gettempdir(), f'klann_ros-foreign-readers-{os.getuid()}')
    folder.mkdir(mode=0o700, exist_ok=True)
    if folder.stat().st_uid != os.getuid():
        pytest.skip(f"{folder} is someone else's")
    installed = folder / 'installed.json'
    if not installed.exists() or installed.read_bytes() != package:
        (folder / 'package.json').write_bytes(package)
        command = [shutil.which('npm'), 'install', '--no-audit', '--no-fund', '--ignore-scripts']
        done = subprocess.run(
            command, cwd=folder, capture_output=True, text=True, timeout=240, check=False
        )
        if done.returncode:
            pytest.skip(f'npm cannot install the readers: {done.stderr.strip()[-200:]}')
        installed.write_bytes(package)
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
    answers = json.loads(done.stdout)
    assert answers['topics'] == {'/crank_angle': len(kept)}
    assert answers['values'] == [
        [str(item.log_time), item.sequence, struct.unpack('<d', item.data[4:])[0]] for item in kept
    ]
    assert answers['attachments'] == ['geometry.yaml']
    assert sorted(answers['metadata']) == ['rosbag2', 'solver']
