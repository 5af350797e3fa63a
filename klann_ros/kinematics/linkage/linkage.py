"""A linkage ready to be solved: its description, its equations, its blocks and its branch."""

from collections.abc import Iterator, Sequence, Set as AbstractSet
from math import degrees

from klann_ros.kinematics.angles import wrap
from klann_ros.kinematics.errors import GeometryError, NotConvergedError
from klann_ros.kinematics.newton import newton_raphson
import numpy as np
from numpy.typing import NDArray

from .blocks import CoupledLoops, Dyad, terms
from .configuration import Configuration
from .decomposition import assembly_order, Group
from .description import Description
from .loops import loop_equations

Array = NDArray[np.float64]
DyadNames = tuple[str, str, str, str]
# The start is a guess of a pose at which the linkage closes: nothing a few corrections do not do.
START_ITERATIONS = 50
# Of |sin| between two links, at the start: nearer to in line it does not say which branch.
LEAST_START_SINE = 1e-6


class Linkage:
    """
    A crank-driven linkage of N bars: immutable; `LinkageLeg` solves it.

    Parameters
    ----------
    description : Description
        The linkage as data.

    Attributes
    ----------
    description : Description
        As given.
    blocks : tuple of Dyad or CoupledLoops
        What is solved, in this order.
    assembly : tuple of int
        The sign (+1 or -1) of each block's sine: how it is put together. The textbook's for the
        Klann leg.
    joint_names : tuple of str
        The names of the angles, the crank's first.

    Raises
    ------
    GeometryError
        The crank does not move it in one definite way, or it cannot be assembled near its start.

    """

    def __init__(self, description: Description) -> None:
        """Derive the equations, and find the branch."""
        self.description = description
        groups = assembly_order(description)
        self.equations = loop_equations(description, groups)
        self.joint_names = tuple(body.angle for body in description.bodies)
        self.senses = tuple(body.sense for body in description.bodies)
        self.i_s = 1j * np.array(self.senses)
        self.blocks = tuple(self._blocks(groups))
        self.foot = description.points.index(description.foot)
        self.foot_terms = terms(self.equations.q_u[self.foot])
        self.foot_constant = complex(self.equations.q[self.foot])
        self.start = self._assembled()
        self.assembly = self._signs()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Linkage) and self.description == other.description

    def __hash__(self) -> int:
        return hash(self.description.name)

    def __repr__(self) -> str:
        return f'<Linkage {self.description.name!r}: {", ".join(self.joint_names)}>'

    def __reduce__(self) -> tuple[type['Linkage'], tuple[Description]]:
        return Linkage, (self.description,)

    @property
    def is_dyadic(self) -> bool:
        """Return whether every block is a dyad, so that two circles each give the pose."""
        return all(isinstance(block, Dyad) for block in self.blocks)

    def f(self, alpha: float, x: Sequence[float] | Array) -> Array:
        """
        Return the loop equations' left-hand sides; the linkage is closed where f = 0.

        Parameters
        ----------
        alpha : float
            Crank angle [rad].
        x : sequence of float, shape (n - 1,)
            The other angles, in the order of `joint_names` [rad].

        Returns
        -------
        numpy.ndarray, shape (n - 1,)
            Of each loop its x equation, then its y equation [m].

        """
        return _rows(self.equations.w @ self.unit_vectors(alpha, x) + self.equations.c)

    def phi(self, alpha: float, x: Sequence[float] | Array) -> Array:
        """Return the Jacobian df/dx, shape (n - 1, n - 1) [m/rad]; parameters as in `f`."""
        return self._jacobian(alpha, x)[:, 1:]

    def f_alpha(self, alpha: float, x: Sequence[float] | Array) -> Array:
        """Return df/dalpha, shape (n - 1,) [m/rad]; parameters as in `f`."""
        column: Array = self._jacobian(alpha, x)[:, 0]
        return column

    def points(self, alpha: float, x: Sequence[float] | Array) -> Array:
        """Return the points, shape (p, 2), in the order of `description.points` [m]."""
        return _plane(self.equations.q_u @ self.unit_vectors(alpha, x) + self.equations.q)

    def points_moved(self, vectors: NDArray[np.complex128]) -> Array:
        """Return the points' derivative, shape (p, 2), from that of the bodies' unit vectors."""
        return _plane(self.equations.q_u @ vectors)

    def unit_vectors(self, alpha: float, x: Sequence[float] | Array) -> NDArray[np.complex128]:
        """Return u_j = exp(i s_j phi_j) of every body, shape (n,)."""
        u: NDArray[np.complex128] = np.exp(self.i_s * np.array([alpha, *x]))
        return u

    def _jacobian(self, alpha: float, x: Sequence[float] | Array) -> Array:
        return _rows(self.equations.w * (self.i_s * self.unit_vectors(alpha, x)))

    def _blocks(self, groups: Sequence[Group]) -> Iterator[Dyad | CoupledLoops]:
        known = {*self.description.pivots, *self.description.crank.points}
        for number, (group, loops) in enumerate(zip(groups, self.equations.rows, strict=True), 1):
            rows, constants = self.equations.w[list(loops)], self.equations.c[list(loops)]
            bodies = [self.description.bodies[j].points for j in group]
            if len(loops) > 1:
                yield CoupledLoops(
                    number, rows=rows, constants=constants, unknowns=group, senses=self.senses
                )
            else:
                yield Dyad(
                    number,
                    row=rows[0],
                    constant=complex(constants[0]),
                    unknowns=(group[0], group[1]),
                    senses=self.senses,
                    names=_names(bodies[0], bodies[1], known),
                )
            known.update(*bodies)

    def _assembled(self) -> tuple[float, ...]:
        """Return the pose that Newton-Raphson reaches from the start, the crank's angle first."""
        alpha, *guess = (self.description.start[name] for name in self.joint_names)
        try:
            iterates = newton_raphson(
                lambda x: self.f(alpha, x),
                lambda x: self.phi(alpha, x),
                np.array(guess),
                alpha=alpha,
                tolerance=1e-9,
                max_iterations=START_ITERATIONS,
            )
        except NotConvergedError as error:
            gaps = np.abs(self.equations.w @ self.unit_vectors(alpha, guess) + self.equations.c)
            widest = int(np.argmax(gaps))
            msg = (
                f'it cannot be assembled near its start: Newton-Raphson finds no pose at the '
                f'crank angle {alpha:g} rad ({degrees(alpha):g} deg); at the start angles the '
                f'loop that closes at {self.equations.closing[widest]} is open by '
                f'{gaps[widest]:.3g} m, check its lengths and these angles'
            )
            raise GeometryError(msg) from error
        return (alpha, *(wrap(angle) for angle in iterates[-1].tolist()))

    def _signs(self) -> tuple[int, ...]:
        u = Configuration(self.senses, self.start).u
        sines = [block.sine(u) for block in self.blocks]
        pairs = zip(sines, self.blocks, strict=True)
        if any(abs(s) <= max(LEAST_START_SINE, b.singular_sine) for s, b in pairs):
            msg = 'its start pose is singular, which leaves the branch open: give another'
            raise GeometryError(msg)
        return tuple(1 if sine > 0.0 else -1 for sine in sines)


def _names(
    a: Sequence[str], b: Sequence[str], known: AbstractSet[str]
) -> tuple[str, str, str, str]:
    """Return what the ends and the links of a dyad are called, by the points that they join."""
    joint = next((point for point in a if point in b and point not in known), '')
    p, q = (next((point for point in body if point in known), '?') for body in (a, b))
    return p, q, p + joint, q + joint


def _rows(values: NDArray[np.complex128]) -> Array:
    """Return complex equations as real ones: of each its x, then its y."""
    return np.stack([values.real, values.imag], axis=1).reshape(-1, *values.shape[1:])


def _plane(values: NDArray[np.complex128]) -> Array:
    return np.stack([values.real, values.imag], axis=-1)
