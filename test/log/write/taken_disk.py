"""
Take the disk of a recording away; to be run in a user namespace of its own.

    unshare -rm python test/log/write/taken_disk.py FOLDER

Mounts a tmpfs on FOLDER, records there, and unmounts it lazily: the run is still written, but has
no name any more. Prints as JSON what was told, and what is in the run.
"""

import json
import os
from pathlib import Path
import shutil
import subprocess
import sys

from crank_runs import make_messages
from klann_ros.log.errors import RunHarmedError
from klann_ros.log.reader import open_log
from klann_ros.log.write.file_watch import Faults
from klann_ros.log.write.writer import RunWriter


def main(folder):
    run = Path(folder, 'run')
    subprocess.run([shutil.which('mount'), '-t', 'tmpfs', 'none', folder], check=True)
    told = []
    writer = RunWriter(run, faults=Faults(told.append), reserve=True)
    disk = os.open(folder, os.O_RDONLY)
    for number, message in enumerate(make_messages(30)):
        if number == 10:
            subprocess.run([shutil.which('umount'), '-l', folder], check=True)
        elif number == 20:
            writer.split()
        writer.write(message)
        writer.flush()
    assert writer.space_problem(1) is None
    try:
        writer.close()
    except RunHarmedError as error:
        told.append(str(error))
    os.fchdir(disk)
    with open_log('run') as log:
        found = len(list(log.messages()))
        assert log.complete, log.problem
    print(json.dumps([found, writer.fate().written.total(), told, list(Path(folder).iterdir())]))


main(*sys.argv[1:])
