"""
Newton-Raphson and the derivatives of a linkage, as straight-line code that is made for it.

Which bodies are in which loop is known when a linkage is made, and never changes. So the loops
over bodies, signs and blocks are run once, while a source text is written (`step_text`); what is
left is arithmetic on local names, as one would write it by hand. One text serves all linkages of a
structure: their numbers are its constants. No name of a user's file is in it, only indices.
"""

from collections.abc import Callable
import linecache
from math import cos, hypot, nan, pi, sin
from typing import Any, NamedTuple

from klann_ros.kinematics.angles import FAR, wrap

from .equations import LoopEquations
from .step_text import Writer
from .structure import Structure

# A guess of coupled loops that needs more correction may have left its branch [rad].
TRUSTED = 0.05


class Step(NamedTuple):
    """The functions of a linkage."""

    # Of alpha, the other angles, the tolerance [rad] and the most iterations: the pose; None where
    # it does not converge, or not on the branch.
    refine: Callable[..., Any]
    # Of alpha, a step of the crank, and the x and coefficients of the pose before it: the same as
    # `refine`, from the guess along the tangent.
    ahead: Callable[..., Any]
    # Of alpha, x, coefficients and the crank's rate: the rates of all angles, and of the foot.
    velocity: Callable[..., Any]
    # Of alpha, x, coefficients, the crank's rate and its change: the same, once more.
    acceleration: Callable[..., Any]


_made: dict[Structure, tuple[Writer, Callable[..., Any]]] = {}


def step(linkage: LoopEquations, kind: type[tuple[Any, ...]]) -> Step:
    """Return the functions of a linkage, for a class of poses."""
    if linkage.structure not in _made:
        writer = Writer(linkage.structure)
        text = writer.text(writer.constants(linkage))
        name = f'<klann_ros step {len(_made)}>'
        # So that a traceback, or a reader, can see the text.
        linecache.cache[name] = (len(text), None, text.splitlines(keepends=True), name)
        names: dict[str, Any] = {
            'cos': cos, 'sin': sin, 'hypot': hypot, 'wrap': wrap, 'pi': pi, 'nan': nan, 'FAR': FAR,
            'TRUSTED': TRUSTED, 'new': tuple.__new__,
        }  # fmt: skip
        exec(compile(text, name, 'exec'), names)  # noqa: S102 - of indices alone
        _made[linkage.structure] = writer, names['make']
    writer, make = _made[linkage.structure]
    return Step(*make(kind, linkage, **writer.constants(linkage)))
