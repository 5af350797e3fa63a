"""
Fill a small disk; to be run in a user namespace of its own.

    unshare -rm python test/log/write/full_disk.py FOLDER SIZE COMPRESSION MIN_FREE_SPACE

Mounts a tmpfs of SIZE bytes on FOLDER, records there until it is full, and prints as JSON what the
recorder says; what was written is copied beside FOLDER, for the mount goes with this process.
"""

import json
from pathlib import Path
import shutil
import subprocess
import sys
from threading import Event

from crank_runs import make_messages
from klann_ros.log.run_parameters import LOSS_RECORD, loss_record, TopicCount
from klann_ros.log.write.background_writer import BackgroundWriter
from klann_ros.log.write.writer import RunWriter


def main(folder, size, compression, least):
    mount = [shutil.which('mount'), '-t', 'tmpfs', '-o', f'size={size}', 'none', folder]
    subprocess.run(mount, check=True)
    writer = RunWriter(
        Path(folder, 'run'), compression=compression, chunk_size=128 * 1024, reserve=True
    )
    full = Event()
    background = BackgroundWriter(
        writer, flush_period=0.05, on_failure=full.set, min_free_space=int(least)
    )
    put = 0
    messages = make_messages(200_000)
    while not full.is_set():
        for message in messages[slice(put, put + 200)]:
            background.put(message)
        put += 200
        full.wait(0.002)

    def describe(run):
        written = run.counts['/crank_angle']
        count = TopicCount(put, written, dropped=put - written)
        run.add_metadata(LOSS_RECORD, loss_record({'/crank_angle': count}))

    failure = background.close(describe)
    whole = writer.failure is None
    shutil.copytree(writer.path, Path(folder).with_name('copy'))
    print(json.dumps([put, writer.counts.get('/crank_angle', 0), str(failure), whole]))


main(*sys.argv[1:])
