"""Linkages of every kind for the tests: the two courses', the shipped ones, and random others."""

from collections.abc import Mapping
import math
from typing import Any

from hypothesis import assume, strategies as st
from klann_ros.kinematics import (
    FourBar,
    GeometryError,
    KinematicsError,
    KlannGeometry,
    KlannLeg,
    Leg,
    Linkage,
    LinkageLeg,
    LinkagePose,
    shipped_linkage,
    shipped_linkages,
)

COURSE = (0.180, 0.080, 0.200, 0.150)
SHIPPED_ROBOTS = ['sem104', 'patent', *shipped_linkages()]
KNOWN: Mapping[str, Leg[Any, Any]] = {
    'sem104': KlannLeg(),
    'patent': KlannLeg(KlannGeometry.patent()),
    'crank-rocker': FourBar(*COURSE),
    'double crank': FourBar(0.08, 0.18, 0.15, 0.2, -1),
    'triple rocker': FourBar(0.3, 0.25, 0.2, 0.24),
    **{name: LinkageLeg(shipped_linkage(name)) for name in shipped_linkages()},
}
NAMES = list(KNOWN)
alphas = st.floats(-50.0, 50.0)


def fresh(name: str) -> Leg[Any, Any]:
    """Return a known leg that has solved nothing yet."""
    known = KNOWN[name]
    if isinstance(known, KlannLeg):
        return KlannLeg(known.geometry)
    if isinstance(known, FourBar):
        return FourBar(*known.geometry.lengths, known.geometry.assembly)
    return LinkageLeg(known.linkage)


def leg_of(linkage: Linkage) -> Leg[Any, Any]:
    """Return a leg of a linkage, or drop the example."""
    try:
        return LinkageLeg(linkage)
    except GeometryError:
        assume(False)
        raise


@st.composite
def legs(draw: st.DrawFn, change: float = 0.05) -> Leg[Any, Any]:
    """Draw a known linkage with every number changed by up to `change`."""
    linkage = KNOWN[draw(st.sampled_from(NAMES))].linkage
    factors = st.floats(1.0 - change, 1.0 + change)
    try:
        changes = {name: value * draw(factors) for name, value in linkage.dimensions.items()}
        return leg_of(linkage.varied(changes))
    except GeometryError:
        assume(False)
        raise


def solved(leg: Leg[Any, Any], alpha: float, sine: float = 0.05) -> LinkagePose:
    """Return a pose that is not close to singular, or drop the example."""
    try:
        pose = leg.solve(alpha)
    except KinematicsError:
        assume(False)
        raise
    assume(min(pose.sines) > sine)
    return pose


def apart(a: float, b: float) -> float:
    """Return the difference of two angles, modulo a turn [rad]."""
    return abs(math.remainder(a - b, 2 * math.pi))


def difference(pose: LinkagePose, other: LinkagePose) -> float:
    """Return the largest difference of two poses' angles, modulo a turn [rad]; or lengths [m]."""
    bodies = pose.linkage.structure.bodies[1:]
    return max(
        abs(a - b) if body.slides else apart(a, b)
        for body, a, b in zip(bodies, pose.x, other.x, strict=True)
    )


def allowed(pose: LinkagePose) -> float:
    """
    Return the difference that a pose's distance from singularity excuses [rad].

    A dyad passes on the error of the one before it, so where several are nearly singular their
    sines multiply.
    """
    nearly = [s for s in pose.sines if s < 1e-3]
    return 1e-11 / max(1e-7, min(1.0, *nearly, 1e3 * math.prod(pose.sines)))
