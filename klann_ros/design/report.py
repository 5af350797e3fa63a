"""The result of a search as text, and its content for JSON."""

from collections.abc import Iterator, Sequence
import json
from pathlib import Path
import shlex
import sys
from typing import Any

from klann_ros.sanitize.text import counted, finite, printable, printable_line

from .figures import FIGURES
from .proof import FoundLeg
from .requirements import Requirements
from .search import SearchResult
from .titles import aims_text, figure_aims

# Legs in the text; design.json has all.
MAX_SHOWN = 12
# Shells of Linux and macOS have an export of their own.
EXPORT = 'export' if sys.platform == 'win32' else 'env export'
# The nodes of a simulated walker, which end with the page's.
WALK = (
    '(for node in solver_node sim_node; do "$node" --ros-args --params-file {0} & done; '
    'walker_node --ros-args --params-file {0} -p use_imu:=true & view_node --open)'
)


def leg_name(number: int) -> str:
    """Return the name of a leg's file, without its ending; `number` counts from 0."""
    return f'leg_{number + 1:03d}'


def next_commands(
    requirements: Requirements, leg: FoundLeg, name: str, folder: Path
) -> list[tuple[str, str]]:
    """Return what comes after a choice, and its command in a shell; each runs as it stands."""

    def path(ending: str) -> str:
        return printable(shlex.quote(f'{folder / name}{ending}'))

    # A motor turns all legs of its walker, and its parts are counted.
    file = path('.yaml' if leg.walker is None else '_walker.yaml')
    options = f'--speed {requirements.speed:.6g}'
    if requirements.load:
        options += f' --load {requirements.load:g}'
    if requirements.motor is not None:
        options += f' --motor {printable(shlex.quote(requirements.motor_file))}'
    plates = f'--svg {path(".svg")} --assembly {path("_assembly.svg")}'
    commands = [
        ('Data sheet', f'describe {file} {options} --html {path(".html")}'),
        ('Parts', f'{EXPORT} {file} --3mf {path(".3mf")} {plates}'),
    ]
    if leg.walker is not None:
        control = f'{EXPORT} {file} --ros2-control {path("_ros2_control")}'
        commands += [('Simulated walker', WALK.format(file)), ('For ros2_control', control)]
    return commands


def search_text(search_result: SearchResult, leg_names: Sequence[str], folder: Path) -> str:
    """Return the result as lines of text."""
    return '\n'.join(_lines(search_result, leg_names, folder)) + '\n'


def _lines(search_result: SearchResult, leg_names: Sequence[str], folder: Path) -> Iterator[str]:
    """Yield the lines of the text: the legs in a table, or the reasons why there is none."""
    requirements = search_result.requirements
    state = search_result.state
    if not search_result.legs:
        yield f'No leg fulfils the requirements, of {state.evaluations} candidates:'
        for reason in search_result.reasons:
            yield f'  {printable_line(reason)}'
        return
    legs = counted(len(search_result.legs), 'leg')
    yield f'{legs} of {state.evaluations} candidates, in {printable(folder)}'
    yield aims_text(requirements)
    names = [*figure_aims(requirements)]
    table = [('', *names, 'linkage')]
    shown_legs = search_result.legs[:MAX_SHOWN]
    for leg, leg_name, title in zip(shown_legs, leg_names, search_result.titles, strict=False):
        figures = [requirements.figure_text(name, leg.reached.get(name)) for name in names]
        linkage = f'{leg.linkage.name}: {title}' if title else leg.linkage.name
        table.append((leg_name, *figures, linkage))
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    for name, *figures, linkage in table:
        cells = [f'{name:<{widths[0]}}', *map(str.rjust, figures, widths[1:-1])]
        yield '  '.join([*cells, printable_line(linkage)]).rstrip()
    more = len(search_result.legs) - MAX_SHOWN
    if more > 0:
        yield f'and {more} more'
    for reason, count in search_result.refused.items():
        yield f'{counted(count, "candidate")} did not pass the proof: {printable_line(reason)}'
    yield f'Compare them: {printable(folder / "index.html")}. Next, of {leg_names[0]}:'
    for _, command in next_commands(requirements, search_result.legs[0], leg_names[0], folder):
        yield f'  {command}'


def report_content(search_result: SearchResult, leg_names: Sequence[str]) -> dict[str, Any]:
    """Return the result for JSON, in SI units."""
    state = search_result.state
    content = {
        'requirements': json.loads(search_result.requirements.text),
        'seed': search_result.seed,
        'evaluations': state.evaluations,
        'refined': search_result.refined,
        'proven': search_result.proven,
        'hypervolumes': list(state.hypervolumes),
        'units': {name: kind.unit for name, kind in FIGURES.items()},
        'reasons': list(search_result.reasons),
        'refused': dict(search_result.refused),
        'legs': list(map(_leg_content, search_result.legs, leg_names, search_result.titles)),
    }
    return dict(finite(content))


def _leg_content(leg: FoundLeg, name: str, title: str) -> dict[str, Any]:
    """Return a leg as JSON has it, with the names of its files."""
    return {
        'file': f'{name}.yaml',
        'walker': f'{name}_walker.yaml' if leg.walker is not None else None,
        'title': title,
        'linkage': leg.linkage.name,
        'assembly': list(leg.linkage.assembly),
        # Its proof.
        'turns_fully': True,
        'dimensions': dict(leg.linkage.dimensions),
        'expected': leg.expected,
        'reached': leg.reached,
        'margins': leg.margins,
        'tolerance': leg.tolerance,
        'non_turning_fraction': leg.non_turning_fraction,
    }
