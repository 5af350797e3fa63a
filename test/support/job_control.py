"""
Run a command as a job on the terminal that is standard input, as a shell with job control does.

It is the leader of the terminal's session. It says on standard output what becomes of the job
(`started PID`, `stopped`, `continued`, `ended STATUS`), and puts it where it is told to by lines
`fg` and `bg` on a file descriptor. Unlike a shell it leaves the terminal's attributes alone, so
that only the job changes them.

    python job_control.py DESCRIPTOR fg|bg COMMAND...
"""

import fcntl
import os
import signal
import subprocess
import sys
import termios
from threading import Thread


def main() -> None:
    """Run it."""
    commands, first, *command = sys.argv[1:]
    # Whoever gives the terminal away while he is in the background would be stopped for it.
    signal.signal(signal.SIGTTOU, signal.SIG_IGN)
    fcntl.ioctl(0, termios.TIOCSCTTY, 0)
    # Whoever started the tests in the background ignores it, and so would the job.
    signal.signal(signal.SIGQUIT, signal.SIG_DFL)
    # There is no thread yet that it could disturb.
    job = subprocess.Popen(
        command,
        stdout=subprocess.DEVNULL,
        preexec_fn=os.setpgrp,  # noqa: PLW1509
    )
    if first == 'fg':
        os.tcsetpgrp(0, job.pid)
    print('started', job.pid, flush=True)
    Thread(target=obey, args=(int(commands), job.pid), daemon=True).start()
    while True:
        _, status = os.waitpid(job.pid, os.WUNTRACED | os.WCONTINUED)
        if os.WIFSTOPPED(status):
            os.tcsetpgrp(0, os.getpgrp())
            print('stopped', flush=True)
        elif os.WIFCONTINUED(status):
            print('continued', flush=True)
        else:
            os.tcsetpgrp(0, os.getpgrp())
            print('ended', os.waitstatus_to_exitcode(status), flush=True)
            return


def obey(commands: int, job: int) -> None:
    """Put the job where it is told to be."""
    with os.fdopen(commands) as lines:
        for line in lines:
            os.tcsetpgrp(0, job if line == 'fg\n' else os.getpgrp())
            os.killpg(job, signal.SIGCONT)


if __name__ == '__main__':
    main()
