"""Every benchmark of the project, one after the other, in the environment made for them."""

import argparse
from pathlib import Path
import tempfile

from environment import environment
import processes
from source import ROOT


def main(arguments: list[str]) -> int:
    """Run the benchmarks; return 0 if every one reached its aim."""
    available = sorted(path.stem for path in (ROOT / 'benchmarks').glob('*.py'))
    parser = argparse.ArgumentParser(
        prog='scripts/benchmark', description='Measure speed, as ratios of the same work.'
    )
    parser.add_argument(
        'name', nargs='*', help=f'one or more of {", ".join(available)}; default: all'
    )
    chosen = parser.parse_args(arguments).name or available
    unknown = [name for name in chosen if name not in available]
    if unknown:
        parser.error(f'no such benchmark: {", ".join(unknown)}')
    missed = []
    with environment('benchmark') as env, tempfile.TemporaryDirectory() as work:
        for name in chosen:
            output = Path(work, name)
            script = ROOT / 'benchmarks' / f'{name}.py'
            code = processes.run([env.python, script], output, env.variables, ROOT)
            print(f'{name}: {output.read_text(encoding="utf-8", errors="replace")}')
            if code:
                missed.append(name)
    if missed:
        print(f'missed their aim: {", ".join(missed)}')
    return 1 if missed else 0
