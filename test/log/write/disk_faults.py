"""
Record while something happens to a disk that no test may do in its own process.

    python test/log/write/disk_faults.py FAULT FOLDER ...

Each fault is a function, whose results are printed as JSON; `fill` and `unmount` need a user
namespace, as of `unshare -rm`.
"""

from collections.abc import Iterator
from contextlib import contextmanager
import json
import os
from pathlib import Path
import shutil
import subprocess
import sys
from threading import Event

from crank_runs import make_messages
from klann_ros.log.errors import RunIncompleteError
from klann_ros.log.reader import open_log
from klann_ros.log.run_parameters import LOSS_RECORD, loss_record, TopicCount
from klann_ros.log.write.background_writer import BackgroundWriter
from klann_ros.log.write.durable_file import RunFaults
from klann_ros.log.write.writer import RunWriter


def fill(folder, size, compression, least):
    """
    Fill a tmpfs of a size on the folder; return what the recorder says.

    What was written is copied beside the folder, for the mount goes with this process.
    """
    mount(folder, '-o', f'size={size}')
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
    return put, writer.counts.get('/crank_angle', 0), str(failure), whole


def unmount(folder):
    """
    Unmount a tmpfs on the folder lazily: the old run has no name any more.

    Return the messages on the old disk, those in the folder, the run's counts and its errors.
    """
    mount(folder)
    run = Path(folder, 'run')
    with recording(run, reserve=True) as (writer, errors):
        disk = os.open(folder, os.O_RDONLY)
        for number, message in enumerate(make_messages(30)):
            if number == 10:
                subprocess.run([shutil.which('umount'), '-l', folder], check=True)
            writer.write(message)
            writer.flush()
        assert writer.space_problem(1) is None
    found = count(run)
    os.fchdir(disk)
    stored = writer.stored_counts()
    counts = stored.written.total(), stored.dropped.total()
    return count('run/run_0.mcap'), found, counts, errors


def forbid(folder):
    """
    Take the permissions of file, run and folder away, as a user who is not root.

    Return the messages found and written, and the errors before and after the end.
    """
    if os.geteuid() == 0:
        os.chown(folder, 65534, 65534)
        os.setuid(65534)
    with recording(Path(folder, 'run')) as (writer, errors):
        places = [Path(folder), writer.path, writer.file.path]
        for number, message in enumerate(make_messages(40)):
            if number and number % 10 == 0:
                places[-(number // 10)].chmod(0)
            writer.write(message)
            writer.flush()
        before = list(errors)
    for path in places:
        path.chmod(0o700)
    return count(writer.path), writer.stored_counts().written.total(), before, errors


def mount(folder, *options):
    command = [shutil.which('mount'), '-t', 'tmpfs', *options, 'none', folder]
    subprocess.run(command, check=True)


@contextmanager
def recording(run: Path, *, reserve: bool = False) -> Iterator[tuple[RunWriter, list[str]]]:
    """Record to a run; yield the writer and its errors, also that of the end."""
    errors: list[str] = []
    writer = RunWriter(run, faults=RunFaults(errors.append), reserve=reserve)
    yield writer, errors
    try:
        writer.close()
    except RunIncompleteError as error:
        errors.append(str(error))


def count(path):
    with open_log(path) as log:
        assert log.complete, log.problem
        return len(list(log.messages()))


print(json.dumps({'fill': fill, 'unmount': unmount, 'forbid': forbid}[sys.argv[1]](*sys.argv[2:])))
