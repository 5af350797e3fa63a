"""What is wrong with a run: each file a kind of check, CHECKS all of them."""

from collections.abc import Callable, Iterator, Sequence
from typing import TypeAlias

from klann_ros.review.model.review import Finding, Review

from .answers import check_answers
from .clocks import check_clocks, check_order
from .completeness import check_container, check_losses, check_told
from .gaps import check_gaps
from .motion import check_motion
from .poses import check_poses
from .solvers import check_solvers
from .torques import check_torques
from .walking import check_walking

Check: TypeAlias = Callable[[Review], Iterator[Finding]]

CHECKS: tuple[Check, ...] = (
    check_container,
    check_solvers,
    check_poses,
    check_answers,
    check_losses,
    check_gaps,
    check_order,
    check_clocks,
    check_motion,
    check_torques,
    check_walking,
    check_told,
)
"""Each yields what it finds in a review; the cause at its source first."""


def findings(review: Review, checks: Sequence[Check] = CHECKS) -> tuple[Finding, ...]:
    """Return what is wrong with a run, the gravest first; nothing for a healthy one."""
    found = (finding for check in checks for finding in check(review))
    return tuple(sorted(found, key=lambda finding: -finding.severity))
