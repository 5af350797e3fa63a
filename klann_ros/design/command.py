"""`design`: the search for legs that fulfil requirements."""

import argparse
from collections.abc import Sequence
from pathlib import Path
import sys

from klann_ros.cli import (
    ArgumentParser,
    check_installed,
    COUNT,
    NOT_READ,
    number_type,
    path,
    SECONDS,
    UsageError,
)
from klann_ros.engines import check_engine, EngineError, ENGINES

from .report import search_text
from .requirements import Requirements, requirements_from_file
from .result_folder import opened_folder
from .search import DEFAULT_EVALUATIONS, Progress, search, State, StateError
from .space import RequirementsError

NONE_FOUND, INTERRUPTED = 1, 130
DESCRIPTION = """\
Search for legs that fulfil requirements. Every leg found is proven to turn fully in one assembly
mode.

REQUIREMENTS is a YAML file: linkage (a name, a file or a list), vary (a percentage, or ranges by
dimension), figures (each minimize, maximize, at_least, at_most or near) and path (points, CSV or
SVG). FOLDER gets leg_001.yaml ..., which every program takes, design.json and index.html."""
EPILOG = """\
The same seed and evaluations give the same files, for any number of jobs. Ctrl-C keeps the
legs found; --resume continues, also after a crash.
Exit code: 0 found, 1 no leg fulfils the requirements (the report names the figure that fails), 2
REQUIREMENTS are refused, 3 FOLDER cannot be written."""


def main(argv: Sequence[str] | None = None) -> int:
    """Search for legs; return the exit code."""
    return _parser().run(_design, {RequirementsError: NOT_READ, EngineError: NOT_READ}, argv)


def _design(options: argparse.Namespace) -> int:
    """Search for legs as the options ask and save them; return the exit code."""
    check_installed('pymoo', 'scipy')
    check_engine(options.engine)
    requirements = requirements_from_file(options.requirements)
    folder = Path(options.output or f'{Path(options.requirements).stem}_legs')
    with opened_folder(folder, resume=options.resume) as (result_folder, state):

        def on_round(state: State, progress: Progress) -> None:
            result_folder.save_state(state)
            print(_line(requirements, progress), file=sys.stderr, flush=True)

        try:
            search_result = search(
                requirements,
                seed=options.seed,
                evaluations=options.evaluations,
                time_limit=options.time,
                jobs=options.jobs,
                engine=options.engine,
                state=state,
                on_round=on_round,
            )
        except StateError as error:
            raise UsageError(f'--resume: {error}') from error
        leg_names, foreign_files = result_folder.save_result(search_result)
    print(search_text(search_result, leg_names, folder), end='')
    if foreign_files:
        print(f'left as they are, not of this search or changed: {", ".join(foreign_files)}')
    if search_result.is_interrupted:
        # Nor is it known then that no leg fulfils them.
        return INTERRUPTED
    return 0 if search_result.legs else NONE_FOUND


def _line(requirements: Requirements, progress: Progress) -> str:
    """Return the progress of a search in a line."""
    best = [
        f'{name} {requirements.figure_text(name, figure)}'
        for name, figure in progress.best.items()
    ]
    state = ', '.join(best) or 'no leg holds the limits yet'
    return f'{progress.evaluations} candidates, {progress.seconds:.0f} s: {state}'


def _parser() -> ArgumentParser:
    parser = ArgumentParser('design', DESCRIPTION, EPILOG)
    add = parser.add_argument
    add('requirements', metavar='REQUIREMENTS', type=path, help='their file')
    folder = 'for the result (default: the name of REQUIREMENTS and _legs); a new one'
    add('-o', '--output', metavar='FOLDER', type=path, help=folder)
    seed = number_type(lambda n: 0 <= n < 2**53, 'a whole number, 0 or more', int)
    add('--seed', metavar='N', type=seed, default=0, help='of the search, 0')
    add('--time', metavar='S', type=SECONDS, help='end the search after this time [s]')
    count = f'candidates tried at most, {DEFAULT_EVALUATIONS}'
    add('--evaluations', metavar='N', type=COUNT, default=DEFAULT_EVALUATIONS, help=count)
    add('--jobs', metavar='N', type=COUNT, help='processes (default: the CPUs)')
    engines = 'processes of this machine, or a Ray cluster'
    add('--engine', choices=ENGINES, default='local', help=engines)
    add('--resume', action='store_true', help='continue the search in FOLDER')
    return parser
