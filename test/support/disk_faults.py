"""
Record while something happens to a disk that no test may do in its own process.

Each fault is a function of this script, whose results are printed as JSON; `fill` needs a user
namespace, as of `unshare -rm`.
"""

import json
import os
from pathlib import Path
import shutil
import subprocess
import sys
from threading import Event

from crank_runs import make_messages
from klann_ros.log.run_parameters import LOSS_RECORD, loss_record, TopicCount
from klann_ros.log.write.background_writer import BackgroundWriter
from klann_ros.log.write.writer import RunWriter
import pytest
from run_faults import Run

# In a user namespace of its own any user may mount.
_UNSHARE = ('unshare', '-rm')
_MOUNT = ('mount', '-t', 'tmpfs', '-o')


def result_of(fault, *arguments):
    """Run a function of this script in a process of its own; return its result."""
    before = _UNSHARE if fault is fill else ()
    if before and shutil.which(before[0]) is None:
        pytest.skip('this machine has no user namespaces')
    done = subprocess.run(
        [*before, sys.executable, __file__, fault.__name__, *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)},
        timeout=60,
    )
    if done.stderr.startswith(('unshare: ', 'mount: ')):
        pytest.skip('this machine cannot mount a tmpfs in a user namespace')
    assert done.stderr == ''
    return json.loads(done.stdout)


def fill(folder, size, compression, least):
    """
    Fill a tmpfs of a size on the folder; return what the recorder says.

    What was written is copied beside the folder, for the mount goes with this process.
    """
    subprocess.run([*_MOUNT, f'size={size}', 'none', folder], check=True)
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
    whole = writer.file.failure is None
    shutil.copytree(writer.path, Path(folder).with_name('copy'))
    return put, writer.counts.get('/crank_angle', 0), str(failure), whole


def forbid(folder):
    """
    Take the permissions of file, run and folder away, as a user who is not root.

    Return the counts of the run, which are those of a reader, and the errors before its end.
    """
    if os.geteuid() == 0:
        os.chown(folder, 65534, 65534)
        os.setuid(65534)
    run = Run(Path(folder, 'run')).write(10)
    places = [run.file(), run.folder, Path(folder)]
    for place in places:
        place.chmod(0)
        run.write(10)
    before = [*run.errors]
    for place in reversed(places):
        place.chmod(0o700)
    return run.close(), before


if __name__ == '__main__':
    print(json.dumps({'fill': fill, 'forbid': forbid}[sys.argv[1]](*sys.argv[2:])))
