"""How a file says that its linkage is put together: a start, an assembly, or both."""

from collections.abc import Sequence
from itertools import islice
from math import radians

from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.errors import GeometryError, NotAssembledError

from .assemblies import MOST_NAMED, named_assemblies, nearest_assembly, possible_assemblies
from .linkage import Linkage
from .reach import closes_somewhere
from .structure import Structure

# A drawing is as good as this [rad].
NEAR = radians(30.0)
IN_DEGREES = 'for degrees write units: {angle: deg}'


def reached(
    plain: Linkage, start: Sequence[float], signs: Sequence[int] | None, *, in_degrees: bool
) -> Linkage:
    """
    Return a linkage in the assembly that its start leads to.

    Parameters
    ----------
    plain : Linkage
        The linkage in whatever assembly.
    start : sequence of float
        An angle for every body, the crank's first [rad], and a distance for what slides [m].
    signs : sequence of int, optional
        The assembly that the file states beside it.
    in_degrees : bool
        Whether the file has its angles in degrees.

    Raises
    ------
    GeometryError
        The start can only be degrees, leads nowhere, or to another assembly than the one stated;
        the text names those that there are.

    """
    if not in_degrees:
        _check_degrees(plain, tuple(start))
    words = plain.name, plain.source
    try:
        made = Linkage(plain.structure, plain.numbers, start=start, name=words[0], source=words[1])
    except NotAssembledError as error:
        there = named_assemblies(plain, start[0], in_degrees=in_degrees)
        raise GeometryError(f'{error}; {there}') from error
    if signs is not None and made.assembly != tuple(signs):
        there = named_assemblies(plain, start[0], in_degrees=in_degrees)
        msg = (
            f'the start leads to the assembly {list(made.assembly)}, and {list(signs)} is stated: '
            f'leave one of them out; {there}'
        )
        raise GeometryError(msg)
    return made


def stated(plain: Linkage, signs: Sequence[int]) -> Linkage:
    """Return a linkage without a start in the assembly that is stated, if it closes anywhere."""
    if not plain.is_dyadic:
        msg = 'it has no start, which its coupled loops need: no assembly tells their branch'
        raise GeometryError(msg)
    count = len(plain.structure.groups)
    if len(signs) == count and closes_somewhere(plain.in_assembly(signs)):
        return plain.in_assembly(signs)
    possible = ', '.join(str(list(one)) for one in islice(possible_assemblies(plain), MOST_NAMED))
    if not possible:
        raise GeometryError('it closes at no crank angle, in whatever assembly: check its lengths')
    msg = f'assembly {signs} is refused: possible are {possible}'
    if len(signs) != count:
        blocks = '; '.join(', '.join(names) for names in _unknowns(plain.structure))
        msg += f', a sign for each of the loops that are solved one after the other ({blocks})'
    raise GeometryError(msg)


def _unknowns(structure: Structure) -> list[list[str]]:
    return [[structure.angles[j] for j in group] for group in structure.groups]


def _check_degrees(linkage: Linkage, start: tuple[float, ...]) -> None:
    """Refuse a start [rad] that can only be degrees."""
    slides = [body.slides for body in linkage.structure.bodies]
    beyond = any(abs(x) > TURN for x, slide in zip(start, slides, strict=True) if not slide)
    near = nearest_assembly(linkage, start) <= NEAR
    if near and not beyond:
        return
    pairs = zip(start, slides, strict=True)
    as_degrees = tuple(x if slide else radians(x) for x, slide in pairs)
    near_in_degrees = nearest_assembly(linkage, as_degrees) <= NEAR
    if near_in_degrees or (beyond and not near):
        given = ', '.join(f'{n} {a:g}' for n, a in zip(linkage.joint_names, start, strict=True))
        there = named_assemblies(linkage, as_degrees[0], in_degrees=True)
        msg = (
            f'the start ({given}) is in radians near no pose in which it closes; {IN_DEGREES}; '
            f'{there}'
        )
        raise GeometryError(msg)
