"""The result of a search as text and JSON."""

from collections.abc import Iterator
import json
from typing import Any

from klann_ros.sanitize.text import counted, finite, printable_line

from .figures import FIGURES
from .proof import FoundLeg
from .requirements import Requirements
from .search import Found

# Legs in the text; design.json has all.
MAX_SHOWN = 12
# Figures in the text beside those of the requirements.
ALSO_SHOWN = ('transmission_angle', 'margin')


def leg_name(number: int) -> str:
    """Return the name of a leg's file, without its ending; `number` counts from 0."""
    return f'leg_{number + 1:03d}'


def shown_figures(requirements: Requirements) -> list[str]:
    """Return the figures that a report shows: those of the requirements, then others."""
    return [*dict.fromkeys((*requirements.figures, *ALSO_SHOWN))]


def text(found: Found, folder: str) -> str:
    """Return the result as lines."""
    return '\n'.join(_lines(found, folder)) + '\n'


def _lines(found: Found, folder: str) -> Iterator[str]:
    requirements, state = found.requirements, found.state
    if not found.legs:
        yield f'No leg fulfils the requirements, of {state.evaluations} candidates:'
        yield from (f'  {printable_line(reason)}' for reason in found.reasons)
        return
    yield f'{counted(len(found.legs), "leg")} of {state.evaluations} candidates, in {folder}'
    names = shown_figures(requirements)
    table = [('', *names, 'linkage')]
    for number, leg in enumerate(found.legs[:MAX_SHOWN]):
        own = [requirements.figure_text(name, leg.reached.get(name)) for name in names]
        table.append((leg_name(number), *own, leg.linkage.name))
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    for row in table:
        cells = [f'{cell:>{w}}' for cell, w in zip(row[1:-1], widths[1:-1], strict=True)]
        yield '  '.join([f'{row[0]:<{widths[0]}}', *cells, printable_line(row[-1])]).rstrip()
    more = len(found.legs) - MAX_SHOWN
    if more > 0:
        yield f'and {more} more'
    for reason, count in found.refused.items():
        yield f'{counted(count, "candidate")} did not pass the proof: {printable_line(reason)}'


def report(found: Found) -> str:
    """Return the result as JSON, in SI units."""
    requirements, state = found.requirements, found.state
    content = {
        'requirements': json.loads(requirements.text),
        'seed': found.seed,
        'evaluations': state.evaluations,
        'hypervolumes': list(state.hypervolumes),
        'units': {name: kind.unit for name, kind in FIGURES.items()},
        'reasons': list(found.reasons),
        'refused': dict(found.refused),
        'legs': [_leg_content(leg, leg_name(n)) for n, leg in enumerate(found.legs)],
    }
    return json.dumps(finite(content), indent=1, allow_nan=False) + '\n'


def _leg_content(leg: FoundLeg, name: str) -> dict[str, Any]:
    return {
        'file': f'{name}.yaml',
        'walker': f'{name}_walker.yaml' if leg.walker is not None else None,
        'linkage': leg.linkage.name,
        'assembly': list(leg.assembly),
        'turns_fully': True,
        'dimensions': dict(leg.linkage.dimensions),
        'expected': leg.expected,
        'reached': leg.reached,
        'margins': {key: list(ends) for key, ends in leg.margins.items()},
        'tolerance': leg.tolerance,
        'non_turning_fraction': leg.non_turning_fraction,
    }
