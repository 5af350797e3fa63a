"""The result of a search as text, and its content for JSON."""

from collections.abc import Iterator, Sequence
import json
from typing import Any

from klann_ros.sanitize.text import counted, finite, printable_line

from .figures import FIGURES
from .proof import FoundLeg
from .requirements import Requirements
from .search import SearchResult

# Legs in the text; design.json has all.
MAX_SHOWN = 12
# Figures in the text beside those of the requirements.
ALSO_SHOWN = ('transmission_angle', 'margin')


def leg_name(number: int) -> str:
    """Return the name of a leg's file, without its ending; `number` counts from 0."""
    return f'leg_{number + 1:03d}'


def shown_figures(requirements: Requirements) -> list[str]:
    """Return the figures that a report shows: those of the requirements, then others."""
    names = [*requirements.figures]
    if requirements.target is not None and not requirements.target.is_timed:
        names.append('point_error')
    return [*dict.fromkeys((*names, *ALSO_SHOWN))]


def search_text(search_result: SearchResult, leg_names: Sequence[str], folder: str) -> str:
    """Return the result as lines of text."""
    return '\n'.join(_lines(search_result, leg_names, folder)) + '\n'


def _lines(search_result: SearchResult, leg_names: Sequence[str], folder: str) -> Iterator[str]:
    """Yield the lines of the text: the legs in a table, or the reasons why there is none."""
    requirements = search_result.requirements
    state = search_result.state
    if not search_result.legs:
        yield f'No leg fulfils the requirements, of {state.evaluations} candidates:'
        for reason in search_result.reasons:
            yield f'  {printable_line(reason)}'
        return
    legs = counted(len(search_result.legs), 'leg')
    yield f'{legs} of {state.evaluations} candidates, in {folder}'
    names = shown_figures(requirements)
    table = [('', *names, 'linkage')]
    for leg, leg_name in zip(search_result.legs[:MAX_SHOWN], leg_names, strict=False):
        figures = [requirements.figure_text(name, leg.reached.get(name)) for name in names]
        table.append((leg_name, *figures, leg.linkage.name))
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    for name, *figures, linkage in table:
        cells = [f'{name:<{widths[0]}}', *map(str.rjust, figures, widths[1:-1])]
        yield '  '.join([*cells, printable_line(linkage)]).rstrip()
    more = len(search_result.legs) - MAX_SHOWN
    if more > 0:
        yield f'and {more} more'
    for reason, count in search_result.refused.items():
        yield f'{counted(count, "candidate")} did not pass the proof: {printable_line(reason)}'


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
        'legs': list(map(_leg_content, search_result.legs, leg_names)),
    }
    return dict(finite(content))


def _leg_content(leg: FoundLeg, name: str) -> dict[str, Any]:
    """Return a leg as JSON has it, with the names of its files."""
    return {
        'file': f'{name}.yaml',
        'walker': f'{name}_walker.yaml' if leg.walker is not None else None,
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
