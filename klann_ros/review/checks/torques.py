"""Whether the efforts of the cranks are what the masses of the legs take."""

from collections.abc import Iterator

from klann_ros.review.model.review import Finding, Review, Severity
from klann_ros.review.model.torques import Torques, torques
from klann_ros.sanitize.text import printable
import numpy as np

# So many standard errors of what is expected are no difference.
_ERRORS = 3.0
# What one moment in a hundred says is no finding, nor what so few do.
_PART, _FEWEST = 0.01, 3
# How much alike both are, from -1 to 1, if one is a multiple of the other.
_ALIKE = 0.95


def check_torques(review: Review) -> Iterator[Finding]:
    """Yield efforts that are others than the masses take, and that are no numbers."""
    legs = review.recording.legs
    for drive in review.recording.drives:
        found = torques(drive, legs)
        if found is None:
            continue
        name = printable(drive.joint)
        title = legs[drive.legs[0]].title if len(drive.legs) == 1 else ''
        if found.invalid:
            text = f'{found.invalid} of {found.told} efforts of {name} are no finite numbers'
            yield Finding('effort', Severity.NOTE, text, 'they are left out', leg=title)
        if any(legs[k].solver.dynamics is None for k in drive.legs):
            text = f'there are efforts of {name}, and nobody tells what it turns weighs'
            meaning = 'a file with bar_density, or masses, judges them: --geometry FILE'
            yield Finding('effort', Severity.NOTE, text, meaning, leg=title)
        elif len(found.times):
            yield from _differences(review, found, name, title)


def _differences(review: Review, found: Torques, name: str, title: str) -> Iterator[Finding]:
    off = np.abs(found.recorded - found.expected)
    peak = float(np.abs(found.expected).max())
    beyond = off - review.limits.torque * peak - _ERRORS * found.accuracy
    # Rounding, where nothing moves and nothing weighs.
    wrong = beyond > 1e-9
    if np.count_nonzero(wrong) < max(_FEWEST, _PART * len(off)):
        return
    worst = int(np.argmax(beyond))
    text = (
        f'the effort of {name} is off the torque that its masses take by up to '
        f'{off[worst]:.3g} N m: recorded {found.recorded[worst]:.3g}, expected '
        f'{found.expected[worst]:.3g} +- {found.accuracy[worst]:.1g} N m'
    )
    time = review.recording.since_start(found.times[worst])
    yield Finding('effort', Severity.WARNING, text, _meaning(found), time, title)


def _meaning(found: Torques) -> str:
    """Return what makes such a difference, as far as both tell."""
    both = float(found.recorded @ found.expected)
    sizes = float(np.linalg.norm(found.recorded) * np.linalg.norm(found.expected))
    alike = both / sizes if sizes else 0.0
    factor = both / float(found.expected @ found.expected) if found.expected.any() else 0.0
    if alike < -_ALIKE:
        return 'it has the opposite sign: the driver, or direction, counts the other way round'
    if alike > _ALIKE and abs(factor - 1.0) > 0.02:
        return f'it is {factor:.2f} times as large: other masses, or a driver with another scale'
    return 'friction, a load on the foot, or other masses than those that are told'
