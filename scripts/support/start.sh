#!/bin/sh
# Choose the Python for a command (demo, test, fuzz, benchmark, lock or wheel) and hand over to main.py.
python=${PYTHON:-python3}

fail() {
    echo "scripts/$1: $(echo "$2" | head -n 1)" >&2
    exit 1
}

command -v "$python" >/dev/null ||
    fail "$1" "$python: no such Python; name one of 3.10 or newer, as in PYTHON=python3.12"
# A pyenv shim may exist and fail. -E and -S: no user settings, no .pth files.
said=$("$python" -ES -c 'import sys
print("%d.%d" % sys.version_info[:2])
sys.exit(3 * (sys.version_info < (3, 10)))' 2>&1)
case $? in
0) exec "$python" -BESsu "$(dirname -- "$0")/main.py" "$@" ;;
3) fail "$1" "$python is Python $said; klann_ros needs 3.10 or newer, as in PYTHON=python3.12" ;;
*) fail "$1" "$python does not run: $said" ;;
esac
