"""
Crank torque, energies, joint reactions and motion of a linkage with masses.

With a single crank, angle a, all follows from the derivatives by a (dashes). With the centres of
mass c, the bodies' rotations phi and the potential energy V,

    I  = sum m |c'|^2 + J phi'^2                     the reduced inertia,
    T  = I a.. + I'/2 a.^2 + V' - sum F . p'         the torque at the crank,

and the joint forces follow from the Newton-Euler equations of each body, without energies: each
method is the other's oracle. (J. J. Uicker, G. R. Pennock, J. E. Shigley, Theory of Machines and
Mechanisms, the chapters on dynamic force analysis.)
"""

from collections.abc import Callable, Mapping
from functools import cached_property
from typing import Any, NamedTuple

from klann_ros.kinematics import (
    as_linkage,
    check_rate,
    FIXED,
    KinematicsError,
    Linkage,
    LinkageLeg,
    PartialTurnError,
    path_arcs,
    real_array,
)
from klann_ros.kinematics.angles import enclosing_turns, TURN
from klann_ros.kinematics.arrays import FloatArray, with_short_repr
from klann_ros.missing_package import install_command
from klann_ros.sanitize.text import refusal
import numpy as np
from numpy.typing import ArrayLike

from .balance import Reactions, reactions
from .masses import MassError, Masses, Spring
from .motion import body_motion, body_motion_at, BodyMotion

# Standard gravity [m/s^2].
GRAVITY = 9.80665
Forces = Mapping[str, tuple[float, float]]
# The crank torque [N m], by time, crank angle and rate [s, rad, rad/s].
Torque = Callable[[float, float, float], float]


@with_short_repr
class TurnOfForces(NamedTuple):
    """
    Torque and power over a turn of the crank at constant speed.

    `alphas`, shape (k,), are ascending crank angles of a turn from 0, or of the turns after which
    a linkage with change points is back [rad], `rate` is the crank's [rad/s], `torque`, shape
    (k,), acts at the crank, positive where it drives counter-clockwise [N m].
    """

    alphas: FloatArray
    rate: float
    torque: FloatArray

    @property
    def power(self) -> FloatArray:
        """Return the power at the crank [W]."""
        return self.torque * self.rate

    @property
    def mean(self) -> float:
        """Return the mean torque [N m]: the work of a turn over 2 pi."""
        return turn_mean(self.alphas, self.torque)

    @property
    def peak(self) -> float:
        """Return the largest magnitude of the torque [N m]."""
        return float(np.abs(self.torque).max())

    @property
    def rms(self) -> float:
        """Return the root mean square of the torque, which heats a motor [N m]."""
        return float(np.sqrt(turn_mean(self.alphas, self.torque**2)))

    @property
    def energy_swing(self) -> float:
        """
        Return the energy fluctuation of a shaft with the mean torque over a turn [J].

        The range of the integral of T - mean, by the trapezoidal rule.
        """
        excess = self.torque - self.mean
        work = np.diff(self.alphas) * (excess[1:] + excess[:-1]) / 2.0
        return float(np.ptp(np.cumsum([0.0, *work])))

    def flywheel(self, unevenness: float) -> float:
        """
        Return the flywheel inertia at the crank for a coefficient of fluctuation [kg m^2].

        Parameters
        ----------
        unevenness : float
            (greatest - least speed) / mean speed, > 0.

        Raises
        ------
        ValueError
            `unevenness` is not > 0, or the rate is 0.

        """
        if not unevenness > 0.0 or self.rate == 0.0:
            raise ValueError(refusal('unevenness', unevenness, '> 0, and the crank must turn'))
        return self.energy_swing / (unevenness * self.rate**2)


def turn_mean(alphas: FloatArray, curve: FloatArray) -> float:
    """Return the mean of a curve over whole turns' ascending angles [rad], by trapezoids."""
    span = TURN * enclosing_turns(alphas)
    steps = np.diff(alphas, append=alphas[0] + span)
    return float((steps * (curve + np.roll(curve, -1))).sum() / (2.0 * span))


class Dynamics:
    """
    A linkage with masses.

    Parameters
    ----------
    linkage : Linkage, KlannGeometry, FourBarGeometry or leg
        The linkage.
    masses : Masses
        The masses of its bodies, and springs.
    gravity : (float, float)
        The acceleration of gravity in the linkage's plane [m/s^2].

    Raises
    ------
    MassError
        The masses are not as many as the bodies.
    TypeError
        `linkage` or `masses` is none.

    """

    def __init__(
        self, linkage: Any, masses: Masses, *, gravity: tuple[float, float] = (0.0, -GRAVITY)
    ) -> None:
        self.linkage: Linkage = as_linkage(linkage)
        if not isinstance(masses, Masses):
            raise TypeError(refusal('masses', masses, 'Masses, as rods(linkage, density) are'))
        self.masses = masses
        bodies = len(self.linkage.structure.bodies)
        if len(masses.bodies) != bodies:
            raise MassError(f'there are {len(masses.bodies)} masses for {bodies} bodies')
        self.gravity = complex(*gravity)

    @cached_property
    def _leg(self) -> LinkageLeg:
        return LinkageLeg(self.linkage)

    def reduced_inertia(self, alphas: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return I and dI/dalpha at crank angles, shape (k,) [kg m^2]; NaN at singular poses."""
        return self._inertia(body_motion(self.linkage, alphas))

    def potential_energy(self, alphas: ArrayLike) -> FloatArray:
        """Return the energy of weight and springs at crank angles, shape (k,) [J]."""
        energy, _ = self._potential(body_motion(self.linkage, alphas))
        return energy

    def kinetic_energy(self, alphas: ArrayLike, alpha_rate: ArrayLike) -> FloatArray:
        """Return the energy of motion at crank angles and rates, shape (k,) [J]."""
        inertia, _ = self.reduced_inertia(alphas)
        rate, _ = _rates(inertia.size, alpha_rate)
        energy: FloatArray = inertia * rate**2 / 2.0
        return energy

    def crank_torque(
        self,
        alphas: ArrayLike,
        alpha_rate: ArrayLike = 0.0,
        alpha_acceleration: ArrayLike = 0.0,
        loads: Forces | None = None,
    ) -> FloatArray:
        """
        Return the crank torque of a motion (inverse dynamics), shape (k,) [N m].

        Parameters
        ----------
        alphas : array-like of float, shape (k,)
            Crank angles [rad].
        alpha_rate, alpha_acceleration : array-like of float
            Rate and acceleration of the crank, one or one for each angle [rad/s, rad/s^2].
        loads : mapping of str to (float, float), optional
            Forces on points [N]; each number may be an array of shape (k,).

        Raises
        ------
        MassError
            There is no such point, or a load is no force.
        ValueError
            The angles, rates or accelerations are no numbers, or do not fit together.

        """
        moving = body_motion(self.linkage, alphas)
        rate, acceleration = _rates(moving.alphas.size, alpha_rate, alpha_acceleration)
        inertia, steady = self._inertia_and_torque(moving, rate)
        torque = inertia * acceleration + steady
        for point, force in self._loads(loads).items():
            torque = torque - _dot(force, moving.point(point)[1])
        return np.asarray(torque, dtype=np.float64)

    def inertia_and_torque(self, alpha: float, alpha_rate: float) -> tuple[float, float]:
        """Return I at a crank angle, and the torque that keeps its rate [kg m^2, N m]."""
        check_rate('alpha_rate', alpha_rate)
        # Successive angles are mostly close: the solver starts from the last pose.
        x = np.array(self._leg.solve(alpha).x)[:, None]
        moving = body_motion_at(self.linkage, np.array([alpha]), x)
        inertia, torque = self._inertia_and_torque(moving, alpha_rate)
        return float(inertia[0]), float(torque[0])

    def reactions(
        self,
        alphas: ArrayLike,
        alpha_rate: ArrayLike = 0.0,
        alpha_acceleration: ArrayLike = 0.0,
        loads: Forces | None = None,
    ) -> Reactions:
        """Return the joint reactions; parameters and errors as `crank_torque`."""
        moving = body_motion(self.linkage, alphas)
        forces = list(self._loads(loads).items())
        for spring in self.masses.springs:
            force = _tension(spring, moving).force
            ends = zip(spring.ends, (force, -force), strict=True)
            forces += [(end, end_force) for end, end_force in ends if isinstance(end, str)]
        rates = _rates(moving.alphas.size, alpha_rate, alpha_acceleration)
        moments = self._moments(moving)
        return reactions(moving, self.masses.bodies, rates, self.gravity, forces, moments)

    def turn(
        self, alpha_rate: float, loads: Forces | None = None, *, samples: int = 720
    ) -> TurnOfForces:
        """
        Return torque and power over a turn of the crank at constant speed.

        Raises
        ------
        PartialTurnError
            The crank does not turn fully.
        MassError, ValueError
            As `crank_torque`; the rate is not finite.

        """
        check_rate('alpha_rate', alpha_rate)
        arcs = path_arcs(self.linkage)
        start, end = arcs[0] if arcs else (0.0, 0.0)
        if end - start < TURN:
            raise PartialTurnError(arcs)
        turns = round(end / TURN)
        alphas = TURN * np.arange(samples * turns) / samples
        return TurnOfForces(
            alphas, float(alpha_rate), self.crank_torque(alphas, alpha_rate, 0.0, loads)
        )

    def _inertia_and_torque(self, moving: BodyMotion, rate: Any) -> tuple[FloatArray, FloatArray]:
        """Return I, and the torque that keeps the rate."""
        inertia, inertia_1 = self._inertia(moving)
        _, slope = self._potential(moving)
        return inertia, inertia_1 / 2.0 * rate**2 + slope

    def _inertia(self, moving: BodyMotion) -> tuple[FloatArray, FloatArray]:
        """Return I and dI/dalpha [kg m^2]."""
        inertia = np.zeros(moving.alphas.size)
        inertia_1 = np.zeros(moving.alphas.size)
        for j, body in enumerate(self.masses.bodies):
            _, c_1, c_2 = moving.fixed_to(j, body.centre)
            inertia += body.mass * np.abs(c_1) ** 2 + body.inertia * moving.rotation_1[j] ** 2
            rotation = moving.rotation_1[j] * moving.rotation_2[j]
            inertia_1 += 2.0 * (body.mass * _dot(c_1, c_2) + body.inertia * rotation)
        return inertia, inertia_1

    def _potential(self, moving: BodyMotion) -> tuple[FloatArray, FloatArray]:
        """Return V of weight and springs [J], and dV/dalpha [N m]."""
        energy = np.zeros(moving.alphas.size)
        slope = np.zeros(moving.alphas.size)
        for j, body in enumerate(self.masses.bodies):
            c, c_1, _ = moving.fixed_to(j, body.centre)
            energy -= body.mass * _dot(self.gravity, c)
            slope -= body.mass * _dot(self.gravity, c_1)
        for spring in self.masses.springs:
            tension = _tension(spring, moving)
            energy += spring.stiffness * tension.elongation**2 / 2.0
            slope += _dot(tension.force, tension.vector_1)
        for torsion_spring in self.masses.torsion_springs:
            deflection = torsion_spring.deflection(self.linkage.structure, moving.u)
            energy += torsion_spring.stiffness * deflection**2 / 2.0
        for j, moment in self._moments(moving):
            slope -= moment * moving.rotation_1[j]
        return energy, slope

    def _moments(self, moving: BodyMotion) -> list[tuple[int, FloatArray]]:
        """Return the moments of torsion springs on bodies, by the bodies' indices [N m]."""
        structure = self.linkage.structure
        moments = []
        for spring in self.masses.torsion_springs:
            moment = spring.stiffness * spring.deflection(structure, moving.u)
            first, second = spring.body_indices(structure)
            moments += [(first, moment), (second, -moment)]
        return [(j, moment) for j, moment in moments if j != FIXED]

    def _loads(self, loads: Forces | None) -> dict[str, Any]:
        points = self.linkage.structure.points
        if not isinstance(loads, Mapping | None):
            raise MassError(refusal('loads', loads, 'a mapping of points to forces (x, y)'))
        vectors = {}
        for point, force in (loads or {}).items():
            if point not in points:
                raise MassError(f'load on {point}: no such point; there are {", ".join(points)}')
            try:
                x, y = force
            except (TypeError, ValueError):
                raise MassError(refusal(f'load on {point}', force, 'a force (x, y)')) from None
            vectors[point] = real_array('force', x) + 1j * real_array('force', y)
        return vectors


def _rates(count: int, rate: ArrayLike, acceleration: ArrayLike = 0.0) -> list[FloatArray]:
    """Return rates of the crank as arrays, one number or `count` each; a ValueError if not."""
    arrays = []
    for name, numbers in (('alpha_rate', rate), ('alpha_acceleration', acceleration)):
        arrays.append(np.asarray(real_array(name, numbers), dtype=np.float64))
        if arrays[-1].shape not in {(), (1,), (count,)}:
            raise ValueError(f'{name} is refused: its shape must be () or ({count},)')
    return arrays


class _Tension(NamedTuple):
    """A spring's elongation [m], its force on its first end [N], and its vector's derivative."""

    elongation: Any
    force: Any
    vector_1: Any


def _tension(spring: Spring, moving: BodyMotion) -> _Tension:
    """Return the tension of a spring at the crank angles of a motion, shape (k,)."""
    (p, p_1), (q, q_1) = (
        moving.point(end)[:2] if isinstance(end, str) else (complex(*end), 0.0)
        for end in spring.ends
    )
    vector = q - p + np.zeros(moving.alphas.size)
    elongation = np.abs(vector) - spring.free_length
    with np.errstate(invalid='ignore', divide='ignore'):
        direction = np.where(vector == 0.0, 0.0, vector / np.abs(vector))
    return _Tension(elongation, spring.stiffness * elongation * direction, q_1 - p_1)


def _dot(a: Any, b: Any) -> Any:
    return np.real(a * np.conj(b))


@with_short_repr
class Simulation(NamedTuple):
    """A motion in time: `times` [s], crank angle and rate [rad, rad/s], shape (k,) each."""

    times: FloatArray
    alpha: FloatArray
    alpha_rate: FloatArray


class NoScipyError(ImportError):
    """scipy is not installed."""


def simulate(
    dynamics: Dynamics,
    torque: Torque | float,
    times: ArrayLike,
    *,
    alpha: float,
    alpha_rate: float = 0.0,
    tolerance: float = 1e-10,
) -> Simulation:
    """
    Return the motion by a crank torque: a.. = (T - V' - I'/2 a.^2) / I.

    Parameters
    ----------
    dynamics : Dynamics
        The linkage with masses.
    torque : callable or float
        The torque at the crank by time, crank angle and rate; or a constant [N m].
    times : array-like of float, shape (k,)
        Times of the returned motion, ascending from the start [s].
    alpha, alpha_rate : float
        Crank angle and rate at the start [rad, rad/s].
    tolerance : float
        Tolerance of the integration, relative and absolute.

    Raises
    ------
    KinematicsError
        The motion reaches a singular pose, or one that does not close.
    NoScipyError
        scipy is not installed: the extra "dynamics".

    """
    try:
        from scipy.integrate import solve_ivp  # noqa: PLC0415 - scipy is optional
    except ImportError as error:
        raise NoScipyError(
            f'a simulation needs scipy: {install_command("scipy", "dynamics")}'
        ) from error
    if not isinstance(dynamics, Dynamics):
        raise TypeError(refusal('dynamics', dynamics, 'the Dynamics of a linkage with masses'))
    if not callable(torque):
        check_rate('torque', torque)
    instants = real_array('times', times)
    if instants.ndim != 1 or len(instants) < 2 or not (np.diff(instants) > 0.0).all():
        raise ValueError('times are refused: they must be two or more, and ascend')

    def derivative(time: float, state: FloatArray) -> tuple[float, float]:
        angle, rate = state.tolist()
        driving_torque = torque(time, angle, rate) if callable(torque) else torque
        inertia, steady_torque = dynamics.inertia_and_torque(angle, rate)
        acceleration = (driving_torque - steady_torque) / inertia
        if not np.isfinite(acceleration):
            msg = f'at {time:.6g} s the crank is at {angle:.6g} rad, where it cannot move on'
            raise KinematicsError(msg)
        return rate, acceleration

    options = {'method': 'DOP853', 't_eval': instants, 'rtol': tolerance, 'atol': tolerance}
    start_state = alpha, alpha_rate
    solution = solve_ivp(derivative, (instants[0], instants[-1]), start_state, **options)
    return Simulation(solution.t, *solution.y)
