"""The Klann leg: its dimensions, with the two legs of the literature, and its solution."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
import math
from typing import Any, ClassVar

from klann_ros.sanitize.units import warn_of_lengths
from numpy.typing import ArrayLike

from . import validation
from .angles import wrap
from .batch.results import LinkagePoses
from .errors import GeometryError
from .linkage.assemblies import assemblies
from .linkage.leg import Leg
from .linkage.linkage import Linkage, NamedGeometry
from .linkage.pose import LinkageMotion, LinkagePose, PoseEntry
from .linkage.reach import closes_somewhere
from .linkage.structure import Bar, Body, Dimension, Structure
from .linkage.variants import Variants

LENGTHS = ('l_ab', 'l_bc', 'l_dc', 'l_cg', 'l_ef', 'l_fg', 'l_gh')
COORDINATES = ('x_d', 'y_a', 'x_e', 'y_e')
BENDS = ('angle_bcg', 'angle_fgh')
NUMBERS = LENGTHS + COORDINATES + BENDS

# The course's letters; its angles gamma and theta are clockwise, and it measures delta + theta
# outside of the joint F.
STRUCTURE = Structure(
    pivots=('A', 'D', 'E'),
    bodies=(
        Body('alpha', (Bar('A', 'B'),), label='crank'),
        Body('gamma', (Bar('B', 'C'), Bar('C', 'G')), clockwise=True, label='coupler'),
        Body('beta', (Bar('D', 'C'),), label='lower rocker'),
        Body('delta', (Bar('E', 'F'),), label='upper rocker'),
        Body('theta', (Bar('F', 'G'), Bar('G', 'H')), clockwise=True, label='leg'),
    ),
    foot='H',
    points=tuple('ABCDEFGH'),
    dimensions=(
        Dimension('l_ab', 'length', 0),
        Dimension('l_bc', 'length', 1),
        Dimension('l_dc', 'length', 3),
        Dimension('l_cg', 'length', 2),
        Dimension('l_ef', 'length', 4),
        Dimension('l_fg', 'length', 5),
        Dimension('l_gh', 'length', 6),
        Dimension('x_d', 'x', 1),
        Dimension('y_a', 'y', 0),
        Dimension('x_e', 'x', 2),
        Dimension('y_e', 'y', 2),
        Dimension('angle_bcg', 'bend', 2),
        # The course bends the leg the other way.
        Dimension('angle_fgh', 'bend', 6, -1),
    ),
    outside=(2,),
)
# The names under which the angles are published and drawn, the crank's first.
JOINTS = STRUCTURE.angles


@dataclass(frozen=True, kw_only=True)
class KlannGeometry(NamedGeometry):
    """
    Lengths, pivots, bends and assembly of a Klann leg; by default the leg of SEM 104.

    The pivots are A = (0, y_a), D = (x_d, 0) and E = (x_e, y_e).

    Parameters
    ----------
    l_ab, l_bc, l_dc, l_cg, l_ef, l_fg, l_gh : float
        Crank AB, coupler BC and CG, lower rocker DC, upper rocker EF, leg FG and GH [m], > 0.
    x_d, y_a, x_e, y_e : float
        Coordinates of the pivots [m], signed.
    angle_bcg, angle_fgh : float
        Bend of the coupler at C and of the leg at G [rad], signed, within +-2 pi; of degrees
        `math.radians` makes them.
    assembly : tuple of int
        The signs (+1 or -1) of sin(gamma + beta) and of sin(delta + theta): the assembly
        mode of each dyad.

    Raises
    ------
    GeometryError
        A value is not a finite number, a length is not positive or beyond all measure, a bend is
        beyond 2 pi, an assembly sign is not +1 or -1, or both dyads close at
        no crank angle. A ValueError.

    References
    ----------
    R. Nicoletti, SEM 104 Mecanismos, lecture 7.

    """

    structure: ClassVar[Structure] = STRUCTURE

    l_ab: float = 0.120
    l_bc: float = 0.350
    l_dc: float = 0.140
    l_cg: float = 0.360
    l_ef: float = 0.270
    l_fg: float = 0.360
    l_gh: float = 0.430
    x_d: float = 0.350
    y_a: float = 0.090
    x_e: float = 0.290
    y_e: float = 0.230
    angle_bcg: float = math.radians(10.0)
    angle_fgh: float = math.radians(40.0)
    assembly: tuple[int, int] = (1, 1)

    def __post_init__(self) -> None:
        object.__setattr__(self, 'assembly', validation.assembly_signs(self.assembly, 2))
        for name, number in zip(NUMBERS, self.linkage.numbers, strict=True):
            object.__setattr__(self, name, number)
        warn_of_lengths({name: getattr(self, name) for name in (*LENGTHS, *COORDINATES)})
        if not closes_somewhere(self.linkage):
            closing = ', '.join(map(str, assemblies(self.linkage)))
            remedy = f'but in {closing}' if closing else 'or in any other'
            raise GeometryError(
                f'these lengths are refused: at no crank angle do both dyads close in the '
                f'assembly {self.assembly}, {remedy}'
            )

    @classmethod
    def sem104(cls) -> 'KlannGeometry':
        """Return the leg of SEM 104, lecture 7: the defaults."""
        return cls()

    @classmethod
    def patent(cls) -> 'KlannGeometry':
        """
        Return the leg of the patent's example (US 6,260,862), 1 unit = 1 m.

        The patent prints the pivots and the pose at a crank angle of 180 deg; that pose fixes the
        lengths, both bends and the assembly. The frame is moved so that A.x = D.y = 0.
        """
        a = (1.599, 0.750)
        b = (1.331, 0.750)
        c = (0.741, 0.750)
        d = (1.009, 0.574)
        e = (1.366, 1.366)
        f = (0.866, 1.500)
        g = (0.232, 0.866)
        h = (0.0, 0.0)
        return cls(
            l_ab=math.dist(a, b),
            l_bc=math.dist(b, c),
            l_dc=math.dist(d, c),
            l_cg=math.dist(c, g),
            l_ef=math.dist(e, f),
            l_fg=math.dist(f, g),
            l_gh=math.dist(g, h),
            x_d=round(d[0] - a[0], 3),
            y_a=round(a[1] - d[1], 3),
            x_e=round(e[0] - a[0], 3),
            y_e=round(e[1] - d[1], 3),
            # gamma = -direction(BC) and gamma - angle_bcg = -direction(CG): clockwise angles.
            angle_bcg=wrap(_direction(c, g) - _direction(b, c)),
            # theta = -direction(FG) and theta + angle_fgh = -direction(GH).
            angle_fgh=wrap(_direction(f, g) - _direction(g, h)),
            assembly=(-1, -1),
        )

    @cached_property
    def linkage(self) -> Linkage:
        """Return the leg as a linkage, the form that is solved."""
        numbers = [getattr(self, name) for name in NUMBERS]
        return Linkage(STRUCTURE, numbers, assembly=self.assembly, name='Klann leg')

    def mirrored(self) -> 'KlannGeometry':
        """
        Return the leg mirrored in the x axis: every angle has the other sign, the crank's too.

        Mirrored in the y axis, as a left leg to a right one, it is this one turned by half a turn.
        """
        changes = {name: -getattr(self, name) for name in ('y_a', 'y_e', *BENDS)}
        first_sign, second_sign = self.assembly
        return replace(self, **changes, assembly=(-first_sign, -second_sign))

    def as_dict(self) -> dict[str, Any]:
        """Return the fields by name, ready for a file: lengths [m], bends [rad], assembly."""
        return {**self.__getstate__(), 'assembly': list(self.assembly)}


PRESETS = {'sem104': KlannGeometry.sem104, 'patent': KlannGeometry.patent}


class KlannPose(LinkagePose):
    """
    A solved pose of the Klann leg: `x` are gamma, beta, delta, theta; `points` A to H.

    gamma (the coupler) and theta (the leg) are clockwise; beta is the lower rocker's angle, delta
    the upper one's. All but alpha are in (-pi, pi] [rad].
    """

    __slots__ = ()

    gamma = PoseEntry('x', 0)
    beta = PoseEntry('x', 1)
    delta = PoseEntry('x', 2)
    theta = PoseEntry('x', 3)


class KlannMotion(LinkageMotion):
    """The velocity or the acceleration of a pose, by the textbook's names [rad/s, rad/s^2]."""

    __slots__ = ()

    alpha = PoseEntry('joints', 0)
    gamma = PoseEntry('joints', 1)
    beta = PoseEntry('joints', 2)
    delta = PoseEntry('joints', 3)
    theta = PoseEntry('joints', 4)


class KlannLeg(Leg[KlannPose, KlannMotion]):
    """
    A Klann leg that is solved for one crank angle after the other.

    Its `f`, `phi` and `newton` are SEM 104's, with x = (gamma, beta, delta, theta)::

        f1 = L_AB cos(alpha) + L_BC cos(gamma) - L_DC cos(beta) - x_D
        f2 = L_AB sin(alpha) - L_BC sin(gamma) - L_DC sin(beta) + y_A
        f3 = L_EF cos(delta) + L_FG cos(theta) - L_CG cos(gamma - bend_C) - L_DC cos(beta)
             - x_D + x_E
        f4 = L_EF sin(delta) - L_FG sin(theta) + L_CG sin(gamma - bend_C) - L_DC sin(beta) + y_E

    Parameters
    ----------
    geometry : KlannGeometry, optional
        The leg; SEM 104's where it is left out.
    tolerance, max_crank_step : float
        As for every `Leg` [rad].

    Raises
    ------
    TypeError
        `geometry` is no KlannGeometry.

    """

    pose_class = KlannPose
    motion_class = KlannMotion

    def __init__(self, geometry: KlannGeometry | None = None, **settings: float) -> None:
        if not isinstance(geometry, KlannGeometry | None):
            raise TypeError(f'geometry = {geometry!r} is refused: it must be a KlannGeometry')
        self._geometry = geometry or KlannGeometry.sem104()
        super().__init__(self._geometry.linkage, **settings)

    def __repr__(self) -> str:
        return f'KlannLeg({self._geometry!r})'

    @property
    def geometry(self) -> KlannGeometry:
        """Return the leg's dimensions."""
        return self._geometry


def _direction(p: tuple[float, float], q: tuple[float, float]) -> float:
    """Return the direction from p to q, counter-clockwise from x [rad]."""
    return math.atan2(q[1] - p[1], q[0] - p[0])


def klann_poses(geometries: Any, alphas: ArrayLike, **options: Any) -> LinkagePoses:
    """
    Return the poses of Klann legs: `linkage_poses` of their geometries.

    `angles` are gamma, beta, delta, theta, and `points` A to H.

    Raises
    ------
    TypeError
        `geometries` is neither a KlannGeometry nor an iterable of them.

    Examples
    --------
    >>> import numpy as np
    >>> poses = klann_poses(KlannGeometry.sem104(), np.linspace(0.0, 2.0 * np.pi, 1_000_000))
    >>> poses.h.shape, int(np.count_nonzero(poses.reason))
    ((1000000, 2), 0)

    """
    # The bulk solver is not loaded where a leg is solved pose by pose.
    from .batch.poses import linkage_poses  # noqa: PLC0415

    if isinstance(geometries, KlannGeometry):
        return linkage_poses(geometries, alphas, **options)
    legs = list(geometries) if isinstance(geometries, Iterable) else [geometries]
    for leg in legs:
        if not isinstance(leg, KlannGeometry):
            raise TypeError(f'geometries: {leg!r} is refused: it must be a KlannGeometry')
    if not legs:
        # An empty batch has the shapes of a Klann leg, too.
        return linkage_poses(Variants(KlannGeometry().linkage, {'l_ab': []}), alphas, **options)
    return linkage_poses(legs, alphas, **options)
