"""Scripts that do to a disk what no test may do in its own process."""

import json
import os
from pathlib import Path
import subprocess
import sys
from typing import Any

# In a user namespace of its own any user may mount.
UNSHARE = ('unshare', '-rm')


def can_mount(folder: Path) -> bool:
    try:
        command = [*UNSHARE, 'mount', '-t', 'tmpfs', '-o', 'size=64k', 'none', str(folder)]
        return subprocess.run(command, capture_output=True, check=False).returncode == 0
    except OSError:
        return False


def run_script(script: Path, *arguments: object, before: tuple[str, ...] = ()) -> Any:
    """Run a script; return what it prints as JSON."""
    done = subprocess.run(
        [*before, sys.executable, script, *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)},
        timeout=60,
    )
    assert done.stderr == ''
    return json.loads(done.stdout)
