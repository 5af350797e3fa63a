"""The checks of a review, one file for each kind; CHECKS lists them all."""

from collections.abc import Callable, Iterator
from typing import TypeAlias

from klann_ros.review.model.review import Finding, Review

from .built_leg import check_dimensions, check_torques
from .clocks import check_clocks, check_order
from .completeness import check_container, check_gaps, check_losses, check_recorder_findings
from .motion import check_motion, check_walking
from .poses import check_answers, check_poses, check_solvers

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
    check_dimensions,
    check_walking,
    check_recorder_findings,
)
"""Each yields findings of a review; causes come before their effects."""
