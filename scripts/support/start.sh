#!/bin/sh
# Choose the Python for a command (demo, test, fuzz or benchmark) and hand over to main.py.
set -u
name=$1
python=${PYTHON:-python3}
newline='
'

fail() {
    echo "scripts/$name: $1" >&2
    exit 1
}

command -v "$python" >/dev/null ||
    fail "$python: no such Python; name one of 3.10 or newer, as in PYTHON=python3.12"

# Found is not enough: a pyenv shim may exist and fail. -E and -S: nobody's settings, no .pth files.
said=$("$python" -ES -c 'import sys
print("%d.%d" % sys.version_info[:2])
sys.exit(3 * (sys.version_info < (3, 10)))' 2>&1)
case $? in
0) ;;
3) fail "$python is Python $said; klann_ros needs 3.10 or newer, as in PYTHON=python3.12" ;;
*) fail "$python does not run: ${said%%"$newline"*}" ;;
esac

# -S also shortens the time before main.py can answer Ctrl-C; it needs the standard library only.
# Until then the traceback of a Python that is not up yet goes nowhere; main.py takes 3 back to 2.
exec "$python" -BESsu "$(dirname -- "$0")/main.py" "$@" 3>&2 2>/dev/null
