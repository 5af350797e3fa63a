"""
Unmount the disk of a recording; to be run in a user namespace of its own.

    unshare -rm python test/log/write/unmounted_disk.py FOLDER

Mounts a tmpfs on FOLDER, records there, and unmounts it lazily: the old run has no name any more.
Prints as JSON the messages on the old disk, those in FOLDER, the run's counts and its errors.
"""

import json
import os
from pathlib import Path
import shutil
import subprocess
import sys

from crank_runs import make_messages
from klann_ros.log.errors import RunIncompleteError
from klann_ros.log.reader import open_log
from klann_ros.log.write.durable_file import RunFaults
from klann_ros.log.write.writer import RunWriter


def main(folder):
    run = Path(folder, 'run')
    subprocess.run([shutil.which('mount'), '-t', 'tmpfs', 'none', folder], check=True)
    errors = []
    writer = RunWriter(run, faults=RunFaults(errors.append), reserve=True)
    disk = os.open(folder, os.O_RDONLY)
    for number, message in enumerate(make_messages(30)):
        if number == 10:
            subprocess.run([shutil.which('umount'), '-l', folder], check=True)
        writer.write(message)
        writer.flush()
    assert writer.space_problem(1) is None
    try:
        writer.close()
    except RunIncompleteError as error:
        errors.append(str(error))
    found = [count(run)]
    os.fchdir(disk)
    found.insert(0, count('run/run_0.mcap'))
    stored = writer.stored_counts()
    print(json.dumps([*found, [stored.written.total(), stored.dropped.total()], errors]))


def count(path):
    with open_log(path) as log:
        assert log.complete, log.problem
        return len(list(log.messages()))


main(*sys.argv[1:])
