"""
Measure the memory of recover, review and reading; jobs and results are lines of JSON.

    echo '["review", ["FILE"]]' | python test/log/read/memory_server.py

Everything is imported once, and each job runs in a forked process with a peak of its own.
"""

import contextlib
import io
import json
import os
from pathlib import Path
import signal
import sys

from klann_ros.log.reader import open_log
from klann_ros.log.recover_command import main as recover
from klann_ros.review.command import main as review

TIMEOUT = 120


def play(arguments):
    """Read all messages."""
    with open_log(arguments[0]) as log:
        return sum(1 for _ in log.messages(start=log.start_time))


JOBS = {'play': play, 'review': review, 'recover': recover}


def measured(job, arguments):
    """Return a job's result, the memory it took over what was there [bytes], and what it said."""
    before, said = peak(), io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        result = JOBS[job](arguments)
    return result, peak() - before, said.getvalue()


def peak():
    """Return the most memory that this process has had [bytes]."""
    status = Path('/proc/self/status').read_text()
    return int(status.split('VmHWM:')[1].split()[0]) * 1024


def main():
    """Do the jobs; a job that does not end by itself has no answer."""
    for line in sys.stdin:
        child = os.fork()
        if child == 0:
            signal.alarm(TIMEOUT)
            print(json.dumps(measured(*json.loads(line))), flush=True)
            os._exit(0)
        if os.waitpid(child, 0)[1]:
            print('null', flush=True)


main()
