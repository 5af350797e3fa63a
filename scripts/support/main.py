"""
Run one of the commands: main.py demo | test | fuzz | benchmark [ARGUMENT ...].

Standard library only; it runs in the chosen Python, before there is any environment. start.sh is
what starts it.
"""

import _signal  # type: ignore[import-not-found]  # built in: there before any file is read

# Nothing is open yet: until stop.listen(), Ctrl-C ends Python without its traceback.
_signal.signal(_signal.SIGINT, _signal.SIG_DFL)

import os  # noqa: E402 - what takes time comes after
import sys  # noqa: E402

import stop  # noqa: E402

# Even before that line Ctrl-C can make Python complain; start.sh has put stderr aside until now.
os.dup2(3, 2)
os.close(3)


def main() -> int:
    """Run the command named first; return the exit code."""
    stop.listen()
    from command import command  # noqa: PLC0415 - it takes time, too

    return command(sys.argv[1], sys.argv[2:])


if __name__ == '__main__':
    sys.exit(main())
