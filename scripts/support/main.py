"""
Run one of the commands: main.py demo | test | fuzz | benchmark | lock | wheel [ARGUMENT ...].

Standard library only: it runs in the Python that start.sh chose, before there is an environment.
"""

import pkgutil
import sys

from processes import CommandError, listen

# Loaded after the handler of Ctrl-C is installed.
COMMANDS = {'demo': 'demo:main', 'test': 'checks:main'}
COMMANDS |= {'fuzz': 'measuring:fuzz', 'benchmark': 'measuring:benchmark'}
COMMANDS |= {'lock': 'lock:main', 'wheel': 'wheel:main'}

if __name__ == '__main__':
    listen()
    try:
        sys.exit(pkgutil.resolve_name(COMMANDS[sys.argv[1]])(sys.argv[2:]))
    except BrokenPipeError:
        # The reader of the output has gone (scripts/test | head).
        sys.exit(1)
    except (CommandError, OSError) as error:
        print(f'scripts/{sys.argv[1]}: {error}', file=sys.stderr)
        sys.exit(getattr(error, 'exit_code', 1))
