"""`design`: the search for legs that fulfil requirements."""

import argparse
from collections.abc import Sequence
import json
import os
from pathlib import Path
import sys

from klann_ros.cli import (
    ArgumentParser,
    check_installed,
    COUNT,
    NOT_READ,
    number_type,
    Output,
    OutputError,
    path,
    SECONDS,
    UsageError,
)
from klann_ros.engines import check_engine, EngineError, ENGINES
from klann_ros.sanitize.files import read_regular
from klann_ros.sanitize.text import parse_json, printable

from .leg_file import leg_text, parameter_text
from .page import page
from .proof import check_file, ProofError
from .report import leg_name, report, search_text
from .requirements import Requirements, requirements_from_file
from .search import DEFAULT_EVALUATIONS, Progress, search, SearchResult, State, StateError
from .space import RequirementsError

NONE_FOUND, INTERRUPTED = 1, 130
STATE = 'search.json'
MAX_STATE_SIZE = 100_000_000
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
    state = _opened(folder, resume=options.resume)

    def on_round(state: State, progress: Progress) -> None:
        _save(folder, STATE, json.dumps(state.content()))
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
    _write(folder, search_result)
    print(search_text(search_result, printable(folder)), end='')
    if search_result.is_interrupted:
        # Nor is it known then that no leg fulfils them.
        return INTERRUPTED
    return 0 if search_result.legs else NONE_FOUND


def _opened(folder: Path, *, resume: bool) -> State | None:
    """Return the state of the search in a folder, which is made; None of a new search."""
    title = printable(folder)
    try:
        if folder.is_dir() and not any(folder.iterdir()):
            # An earlier search ended in its first round.
            return None
        if resume:
            return State.of(parse_json(read_regular(folder / STATE, MAX_STATE_SIZE)))
        folder.mkdir(parents=True)
    except FileExistsError as error:
        advice = 'continue it with --resume, or choose another with -o'
        raise OutputError(f'{title} exists already: {advice}') from error
    except (OSError, ValueError) as error:
        reason = getattr(error, 'strerror', None) or error
        if resume:
            raise UsageError(
                f'--resume: {title}/{STATE} cannot be read: {printable(reason)}'
            ) from error
        raise OutputError(f'{title} cannot be made: {printable(reason)}') from error
    return None


def _write(folder: Path, search_result: SearchResult) -> None:
    """Write all files of a result; those of legs that an earlier one had are removed."""
    requirements = search_result.requirements
    names: list[str] = []
    for number, leg in enumerate(search_result.legs):
        name = leg_name(number)
        head = '# Found by design; its figures:\n'
        for figure in requirements.figures:
            head += f'#   {figure}: {requirements.figure_text(figure, leg.reached.get(figure))}\n'
        _save(folder, f'{name}.yaml', head + leg_text(leg.leg))
        try:
            check_file(folder / f'{name}.yaml', leg)
        except ProofError as error:
            raise OutputError(str(error)) from error
        names.append(f'{name}.yaml')
        if leg.walker is not None:
            names.append(f'{name}_walker.yaml')
            _save(folder, names[-1], f'# A walker of {name}.yaml.\n{parameter_text(leg.walker)}')
    for old in folder.glob('leg_*.yaml'):
        if old.name not in names and not old.is_symlink():
            old.unlink(missing_ok=True)
    _save(folder, 'design.json', report(search_result))
    _save(folder, 'index.html', page(search_result))


def _save(folder: Path, name: str, content: str) -> None:
    file = folder / name
    if file.is_symlink():
        raise OutputError(f'{printable(file)} is a link, which is not followed')
    Output('-o', os.fspath(file)).write(content.encode(errors='replace'))


def _line(requirements: Requirements, progress: Progress) -> str:
    """Return the progress of a search in a line."""
    best = [
        f'{name} {requirements.figure_text(name, figure)}'
        for name, figure in progress.best.items()
    ]
    state = ', '.join(best) or 'no leg holds the limits yet'
    return (
        f'{progress.evaluations} candidates, {progress.seconds:.0f} s: '
        f'{state}; hypervolume {progress.hypervolume:.3f}'
    )


def _parser() -> ArgumentParser:
    parser = ArgumentParser('design', DESCRIPTION, EPILOG)
    add = parser.add_argument
    add('requirements', metavar='REQUIREMENTS', type=path, help='their file')
    folder = 'for the result (default: the name of REQUIREMENTS and _legs); a new one'
    add('-o', '--output', metavar='FOLDER', type=path, help=folder)
    seed = number_type(lambda n: 0 <= n < 2**53, 'a whole number, 0 or more', int)
    add('--seed', metavar='N', type=seed, default=0, help='of the search, 0')
    add('--time', metavar='S', type=SECONDS, help='end the search after this time [s]')
    count = f'candidates that are judged, {DEFAULT_EVALUATIONS}'
    add('--evaluations', metavar='N', type=COUNT, default=DEFAULT_EVALUATIONS, help=count)
    add('--jobs', metavar='N', type=COUNT, help='processes (default: the CPUs)')
    engines = 'processes of this machine, or a Ray cluster'
    add('--engine', choices=ENGINES, default='local', help=engines)
    add('--resume', action='store_true', help='continue the search in FOLDER')
    return parser
