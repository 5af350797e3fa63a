"""Hypothesis strategies: legs and crank angles as users and their mistakes make them."""

from dataclasses import replace
import math

from hypothesis import assume, strategies as st
from klann_ros.kinematics import GeometryError, KlannGeometry
from klann_ros.kinematics.klann import COORDINATES, LENGTHS

crank_angles = st.floats(-50.0, 50.0)


@st.composite
def legs(draw: st.DrawFn, change: float = 0.3) -> KlannGeometry:
    """Draw a leg: a known one with every number changed by up to `change`, in any assembly."""
    base = draw(st.sampled_from([KlannGeometry.sem104(), KlannGeometry.patent()]))
    factors = st.floats(1.0 - change, 1.0 + change)
    numbers = {name: getattr(base, name) * draw(factors) for name in LENGTHS + COORDINATES}
    bends = {name: draw(st.floats(-math.pi, math.pi)) for name in ('angle_bcg', 'angle_fgh')}
    if draw(st.booleans()):
        bends = {}
    assembly = draw(st.one_of(st.just(base.assembly), st.tuples(signs, signs)))
    try:
        return replace(base, **numbers, **bends, assembly=assembly)
    except GeometryError:
        assume(False)
        raise


signs = st.sampled_from([-1, 1])
