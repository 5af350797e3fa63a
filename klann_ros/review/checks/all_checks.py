"""All checks of a run."""

from klann_ros.review.finding import Finding
from klann_ros.review.reviewed import Review
import numpy as np

from . import answers, clocks, container, gaps, loss, motion, poses, solvers

# The cause at its source first.
CHECKS = (container, solvers, poses, answers, loss, gaps, clocks, motion)


def findings(review: Review) -> tuple[Finding, ...]:
    """Return what is wrong with a run, the gravest first; nothing for a healthy one."""
    # A log may hold any number: what overflows is infinite, and what has no value is NaN.
    with np.errstate(over='ignore', invalid='ignore'):
        found = [finding for each in CHECKS for finding in each.check(review)]
    return tuple(sorted(found, key=lambda finding: -finding.severity))
