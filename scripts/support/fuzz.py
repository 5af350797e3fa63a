"""Runs damaged at random, in the environment of the tests."""

import os
from pathlib import Path
import tempfile

from environment import environment
import processes
from source import ROOT


def main(arguments: list[str]) -> int:
    """Run `test/fuzzing`; return 0 if no case broke a law."""
    with environment('test') as env, tempfile.TemporaryDirectory(prefix='klann_ros-') as work:
        paths = [str(ROOT / 'test'), env.variables.get('PYTHONPATH', '')]
        variables = env.variables | {'PYTHONPATH': os.pathsep.join(filter(None, paths))}
        output = Path(work, 'fuzz.txt')
        command: list[str | Path] = [env.python, '-m', 'fuzzing', *arguments]
        code = processes.run(command, output, variables, ROOT)
        print(output.read_text(encoding='utf-8', errors='replace'), end='')
    return 1 if code is None else code
