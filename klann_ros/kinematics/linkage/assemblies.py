"""
The assembly modes of a linkage.

Each dyad has two, its joint on one side of its ends or on the other; the signs of all dyads are
the assembly. Coupled loops have more, which signs do not distinguish: Newton-Raphson searches them
from many starting points.
"""

from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import islice, product
from math import degrees, pi
from typing import Any

from klann_ros.kinematics import errors
from klann_ros.kinematics.angles import crank_angle
from klann_ros.kinematics.arrays import FloatArray
from klann_ros.kinematics.newton import newton_raphson
import numpy as np

from .linkage import as_linkage, Linkage
from .pose import closed_form_vectors, closed_pose, LinkagePose
from .reach import closes_somewhere, reachable_arcs

# Starting points of the search for coupled loops, and what of them counts as converged [rad, m].
START_COUNT = 400
TOLERANCE = 1e-10
ITERATIONS = 30
# Poses nearer than this are the same.
SAME_POSE_TOLERANCE = 1e-6
# Assemblies that a line of text names.
MAX_NAMED = 4


def assemblies(linkage: Any) -> list[tuple[int, ...]]:
    """
    Return every assembly in which a linkage of dyads closes at some crank angle.

    Parameters
    ----------
    linkage : Linkage, KlannGeometry, FourBarGeometry or leg
        The linkage, in any assembly.

    Returns
    -------
    list of tuple of int
        Signs, +1 or -1 for each block, as in `Linkage.assembly`; `Linkage.in_assembly` takes them.

    Raises
    ------
    GeometryError
        Its loops are coupled: no signs distinguish its assemblies; see `assembly_poses`.
    TypeError
        `linkage` is none of these.

    Examples
    --------
    >>> from klann_ros.kinematics import KlannGeometry
    >>> assemblies(KlannGeometry.sem104())
    [(1, 1), (1, -1), (-1, 1), (-1, -1)]

    """
    return list(possible_assemblies(as_linkage(linkage)))


def assembly_poses(linkage: Any, alpha: float) -> list[LinkagePose]:
    """
    Return the pose of every assembly at a crank angle.

    Each pose's `linkage` has its assembly mode: `LinkageLeg(pose.linkage)` continues from it.

    Parameters
    ----------
    linkage : Linkage, KlannGeometry, FourBarGeometry or leg
        The linkage, in any assembly.
    alpha : float
        Crank angle [rad].

    Returns
    -------
    list of LinkagePose
        One for each assembly that closes at this angle, in the order of `assemblies`. Of coupled
        loops those that Newton-Raphson finds from 400 starting points, which may not be all.

    Raises
    ------
    CrankAngleError
        `alpha` is not finite, or beyond +-1e6 rad.
    TypeError
        `linkage` is none of these.

    Examples
    --------
    >>> from math import degrees, radians
    >>> from klann_ros.kinematics import FourBar
    >>> for pose in assembly_poses(FourBar(180, 80, 200, 150), radians(60)):
    ...     print(pose.linkage.assembly, [round(degrees(x) % 360, 2) for x in pose.x])
    (1,) [21.56, 72.14]
    (-1,) [285.78, 235.2]

    """
    return list(_poses(as_linkage(linkage), crank_angle(alpha)))


def possible_assemblies(linkage: Linkage) -> Iterator[tuple[int, ...]]:
    """Yield `assemblies` one by one: ten dyads have a thousand."""
    for signs in product(*_block_signs(linkage)):
        if closes_somewhere(linkage.in_assembly(signs)):
            yield signs


def _block_signs(linkage: Linkage) -> list[tuple[int, ...]]:
    """Return the signs that each block can have: two lines meet in one way only."""
    return [(1, -1) if block.two_branches else (1,) for block in linkage.blocks]


def _poses(linkage: Linkage, alpha: float) -> Iterator[LinkagePose]:
    if linkage.is_dyadic:
        return _poses_of_dyads(linkage, alpha)
    return _poses_of_coupled_loops(linkage, alpha)


def _poses_of_dyads(linkage: Linkage, alpha: float) -> Iterator[LinkagePose]:
    failed: tuple[int, ...] = ()
    for signs in product(*_block_signs(linkage)):
        # A dyad that fails does so whatever the signs of later dyads are.
        if failed and signs[: len(failed) - 1] == failed[:-1]:
            continue
        try:
            u = closed_form_vectors(linkage, alpha, signs)
        except errors.UnreachableError as error:
            failed = signs[: error.dyad]
            continue
        yield closed_pose(linkage.in_assembly(signs, alpha), u, alpha)


def _poses_of_coupled_loops(linkage: Linkage, alpha: float) -> Iterator[LinkagePose]:
    """Yield the distinct poses that Newton-Raphson finds from many guesses."""
    solutions: list[FloatArray] = []
    for guess in _guesses(linkage):
        x = _newton(linkage, alpha, guess)
        if x is None:
            continue
        differences = [_max_difference(linkage, x, solution) for solution in solutions]
        if min(differences, default=np.inf) <= SAME_POSE_TOLERANCE:
            continue
        solutions.append(x)
        # At a singular pose two assemblies meet.
        with suppress(errors.GeometryError):
            assembled = linkage.from_start([alpha, *x.tolist()])
            u = assembled.vectors(assembled.start[0], assembled.start[1:])
            yield closed_pose(assembled, u.tolist(), alpha)


def _guesses(linkage: Linkage) -> FloatArray:
    """Return starting points, evenly spread over all angles, always the same."""
    count = len(linkage.structure.bodies) - 1
    # Kronecker's sequence of the roots of x^(n + 1) = x + 1: M. Roberts, 2018.
    root = 2.0
    for _ in range(60):
        root = (1.0 + root) ** (1.0 / (count + 1))
    steps = root ** -np.arange(1.0, count + 1)
    guesses: FloatArray = np.arange(1, START_COUNT + 1)[:, None] * steps % 1.0
    # Distances are likely to be within twice the longest vector.
    largest = [2.0 * linkage.size if body.slides else pi for body in linkage.structure.bodies[1:]]
    return np.asarray((2.0 * guesses - 1.0) * np.array(largest))


def _newton(linkage: Linkage, alpha: float, guess: FloatArray) -> FloatArray | None:
    try:
        limits: Any = {'tolerance': TOLERANCE, 'max_iterations': ITERATIONS}
        x = newton_raphson(linkage, alpha, guess, **limits)[-1]
    except (errors.NotConvergedError, errors.LoopsOpenError):
        return None
    return np.array(linkage.wrapped(x))


def _max_difference(linkage: Linkage, x: Any, y: Any) -> float:
    """Return the largest coordinate difference of two poses, modulo whole turns [rad]."""
    return max(map(abs, linkage.coordinate_differences(x, y)))


def distance_to_assembly(linkage: Linkage, start: tuple[float, ...]) -> float:
    """Return the distance of a start to the nearest assembly at its crank angle; inf for none."""
    alpha, *x = start
    # Newton-Raphson first: there may be thousands of assemblies.
    solution = _newton(linkage, alpha, np.array(x))
    distances = [_max_difference(linkage, solution, x)] if solution is not None else []
    if linkage.is_dyadic and len(linkage.structure.groups) <= 8:
        distances += [_max_difference(linkage, pose.x, x) for pose in _poses(linkage, alpha)]
    return float(min(distances, default=np.inf))


def describe_assemblies(linkage: Linkage, alpha: float, *, in_degrees: bool) -> str:
    """Return in words which assemblies there are at a crank angle, and their angles."""
    in_unit: Callable[[float], float] = degrees if in_degrees else float
    unit = 'deg' if in_degrees else 'rad'
    crank = f'{linkage.joint_names[0]} = {in_unit(alpha):g} {unit}'
    poses = list(islice(_poses(linkage, alpha), MAX_NAMED + 1))
    if not poses:
        text = f'in no assembly it closes at {crank}'
        possible = next(possible_assemblies(linkage), None) if linkage.is_dyadic else None
        if possible is None:
            return text
        arcs = reachable_arcs(linkage.in_assembly(possible))
        spans = [f'{in_unit(start):.4g} .. {in_unit(end):.4g} {unit}' for start, end in arcs]
        return f'{text}, in {list(possible)} it does at {" and ".join(spans)}'
    texts = []
    for pose in poses[:MAX_NAMED]:
        by_body = [*zip(linkage.structure.bodies[1:], pose.x, strict=True)]
        angles = [f'{body.angle} {in_unit(x):.4g}' for body, x in by_body if not body.slides]
        lengths = [f'{body.angle} {x:.4g}' for body, x in by_body if body.slides]
        coordinates = [', '.join(angles) + f' {unit}'] if angles else []
        coordinates += [', '.join(lengths) + ' m'] if lengths else []
        texts.append(f'{list(pose.linkage.assembly)} ({", ".join(coordinates)})')
    more = ' and others' if len(poses) > MAX_NAMED else ''
    return f'at {crank} there are the assemblies {"; ".join(texts)}{more}'
