"""Programs that are run by hand: the benchmarks, and the fuzzer."""

import argparse
import os

from environment import Environment, environment
from processes import run
from source import ROOT


def benchmark(arguments: list[str]) -> int:
    """Run the benchmarks; return 0 if every one reached its aim."""
    scripts = {path.stem: path for path in sorted((ROOT / 'benchmarks').glob('*.py'))}
    parser = argparse.ArgumentParser(
        prog='scripts/benchmark', description='Measure speed, as ratios of the same work.'
    )
    parser.add_argument('name', nargs='*', help=f'of {", ".join(scripts)}; default: all')
    parser.add_argument('--full', action='store_true', help='as published: up to hours')
    options = parser.parse_args(arguments)
    names = options.name or list(scripts)
    length = ['--full'] if options.full else []
    unknown = [name for name in names if name not in scripts]
    if unknown:
        parser.error(f'no such benchmark: {", ".join(unknown)}')
    missed = []
    with environment('benchmark') as env:
        for name in names:
            print(f'{name}: ', end='', flush=True)
            if run([env.python, scripts[name], *length], _with_tests(env)) != 0:
                missed.append(name)
    if missed:
        print(f'missed their aim: {", ".join(missed)}')
    return 1 if missed else 0


def fuzz(arguments: list[str]) -> int:
    """Run `test/fuzzing` in the environment of the tests; return 0 if no case broke a law."""
    with environment('test') as env:
        code = run([env.python, '-m', 'fuzzing', *arguments], _with_tests(env))
    return 1 if code is None else code


def _with_tests(env: Environment) -> dict[str, str]:
    """Return the variables of a program that imports modules of the tests and of this folder."""
    folders = [ROOT / 'test', ROOT / 'test' / 'support', ROOT / 'scripts' / 'support']
    paths = [*map(str, folders), env.variables.get('PYTHONPATH', '')]
    return env.variables | {'PYTHONPATH': os.pathsep.join(filter(None, paths))}
