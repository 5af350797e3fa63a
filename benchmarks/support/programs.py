"""Programs as processes of their own, and their costs, measured from outside."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
import os
from pathlib import Path
import subprocess
import sys
from time import monotonic
from typing import Any, NamedTuple

# The traffic stays on this machine and in a domain of its own.
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
os.environ.setdefault('ROS_DOMAIN_ID', '90')
STOP_TIME = 5.0


class Usage(NamedTuple):
    """Exit code of a program, time and CPU time [s], peak of its memory [MB]."""

    code: int
    seconds: float
    cpu: float
    memory: float


def command(name: str, *arguments: object, **parameters: object) -> list[str]:
    """Return the command line of an executable with arguments and parameters of ROS."""
    code = f'import sys; from klann_ros.executables import {name}; sys.exit({name}())'
    line = [sys.executable, '-c', code, *map(str, arguments)]
    if parameters:
        line.append('--ros-args')
    for parameter, setting in parameters.items():
        line += ['-p', f'{parameter}:={setting}']
    return line


def support_command(name: str, *arguments: object) -> list[str]:
    """Return the command line of a program of this folder."""
    return [sys.executable, str(Path(__file__).with_name(f'{name}.py')), *map(str, arguments)]


@contextmanager
def started(line: Sequence[str], **options: Any) -> Iterator[subprocess.Popen[Any]]:
    """Start a process, and end it."""
    process = subprocess.Popen(line, **options)
    try:
        yield process
    finally:
        end(process)


def end(process: subprocess.Popen[Any]) -> None:
    """Stop a process by a signal; kill it if it goes on."""
    process.terminate()
    try:
        process.wait(STOP_TIME)
    except subprocess.TimeoutExpired:
        # rclpy.spin of a relay now and then sleeps through the signal.
        process.kill()
        process.wait()


def finished(line: Sequence[str]) -> Usage:
    """Run a program to its end."""
    start_time = monotonic()
    process = subprocess.Popen(line, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    cpu = usage.ru_utime + usage.ru_stime
    return Usage(process.returncode, monotonic() - start_time, cpu, usage.ru_maxrss / 1000)


def cpu_of(process: int) -> float:
    """Return the time that all threads of a process have run [s]."""
    threads = Path(f'/proc/{process}/task').iterdir()
    return sum(int((thread / 'schedstat').read_text().split()[0]) for thread in threads) / 1e9


def memory_of(process: int) -> float:
    """Return the resident memory of a process [MB]."""
    pages = int(Path(f'/proc/{process}/statm').read_text().split()[1])
    return pages * os.sysconf('SC_PAGE_SIZE') / 1e6
