"""The textbook's view of a linkage: its equations, their Jacobian, and Newton-Raphson by hand."""

from collections.abc import Sequence
from typing import Any

from klann_ros.kinematics import validation
from klann_ros.kinematics.angles import crank_angle
from klann_ros.kinematics.arrays import FloatArray
from klann_ros.kinematics.errors import NotConvergedError, SingularPoseError
from klann_ros.kinematics.newton import Iterations, newton_raphson
import numpy as np

from .assemblies import assembly_poses
from .linkage import Linkage


class Textbook:
    """The textbook methods of a leg; they neither read nor set the last pose."""

    @property
    def linkage(self) -> Linkage:
        """Return the linkage."""
        raise NotImplementedError

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Return the names of its angles, the crank's first."""
        return self.linkage.joint_names

    @property
    def tolerance(self) -> float:
        """Return the largest correction of a converged pose [rad]."""
        raise NotImplementedError

    def f(self, alpha: float, x: Sequence[float] | FloatArray) -> FloatArray:
        """
        Return the loop equations' left-hand sides, in the textbook's order and signs.

        Parameters
        ----------
        alpha : float
            Crank angle [rad].
        x : sequence of float, shape (n - 1,)
            The other angles, in the order of `joint_names` [rad].

        Returns
        -------
        numpy.ndarray, shape (n - 1,)
            Of each loop its x equation, then its y equation [m]; the linkage closes where all are
            0.

        Raises
        ------
        CrankAngleError
            `alpha` is not finite, or beyond +-1e6 rad.
        ValueError
            `x` is not as many finite numbers.

        """
        return self.linkage.f(crank_angle(alpha), self._x('x', x))

    def phi(self, alpha: float, x: Sequence[float] | FloatArray) -> FloatArray:
        """Return the Jacobian Phi = df/dx, shape (n - 1, n - 1) [m/rad]; see `f`."""
        return self.linkage.phi(crank_angle(alpha), self._x('x', x))

    def correction(self, alpha: float, x: Sequence[float] | FloatArray) -> FloatArray:
        """
        Return -Phi^-1 f, what Newton-Raphson adds to an estimate x, shape (n - 1,) [rad].

        Parameters and errors as for `f`.

        Raises
        ------
        SingularPoseError
            Phi cannot be inverted.

        """
        try:
            step = np.linalg.solve(self.phi(alpha, x), self.f(alpha, x))
        except np.linalg.LinAlgError:
            raise SingularPoseError(crank_angle(alpha)) from None
        return np.asarray(-step, dtype=np.float64)

    def _x(self, name: str, x: Sequence[float] | FloatArray) -> FloatArray:
        return validation.guess(x, ', '.join(self.joint_names[1:]), name)

    def newton(
        self,
        alpha: float,
        guess: Sequence[float] | FloatArray,
        *,
        max_iterations: int = 50,
        tolerance: float | None = None,
        residual: float | None = None,
    ) -> FloatArray:
        """
        Return the iterates of the textbook's Newton-Raphson, on whichever branch they end.

        It stops at the first iterate whose correction was at most `tolerance`; with `residual` at
        the first whose equations are all open by less than that; with both where both hold.

        Parameters
        ----------
        alpha : float
            Crank angle [rad].
        guess : sequence of float, shape (n - 1,)
            The other angles of the first iterate, in the order of `joint_names` [rad].
        max_iterations : int
            How many corrections it may make.
        tolerance : float, optional
            Convergence limit of every correction [rad]; the leg's where
            neither it nor `residual` is given.
        residual : float, optional
            What every `|f|` must be below [m]: the stop of the four-bar's course.

        Returns
        -------
        numpy.ndarray, shape (k, n - 1)
            The iterates [rad], neither rounded nor wrapped; row 0 is the guess. `iterations` has
            f, Phi and the corrections beside them.

        Raises
        ------
        NotConvergedError
            It carries the iterates.
        CrankAngleError
            `alpha` is not finite, or beyond +-1e6 rad.
        ValueError
            The guess is not as many finite numbers, `max_iterations` no whole number >= 0, or
            `tolerance` or `residual` not finite and > 0.

        """
        alpha = crank_angle(alpha)
        linkage = self.linkage
        if tolerance is not None:
            tolerance = validation.setting('tolerance', tolerance)
        if residual is not None:
            residual = validation.setting('residual', residual)
        elif tolerance is None:
            tolerance = self.tolerance
        try:
            return newton_raphson(
                lambda x: linkage.f(alpha, x),
                lambda x: linkage.phi(alpha, x),
                self._x('guess', guess),
                alpha=alpha,
                tolerance=tolerance,
                max_iterations=max_iterations,
                residual=residual,
            )
        except NotConvergedError as error:
            if not linkage.is_dyadic or assembly_poses(linkage, alpha):
                raise
            reason = f'{error.reason}; at this crank angle it closes in no assembly'
            raise NotConvergedError(alpha, error.iterates, reason) from None

    def iterations(
        self, alpha: float, guess: Sequence[float] | FloatArray, **stop: Any
    ) -> Iterations:
        """
        Return a run of `newton` with f, Phi and the corrections; `print` shows it as a table.

        Parameters
        ----------
        alpha, guess
            As for `newton`.
        **stop
            `max_iterations`, `tolerance` and `residual` as for `newton`.

        Returns
        -------
        Iterations
            The iterates, f and Phi at each, and the corrections.

        Raises
        ------
        NotConvergedError, CrankAngleError, ValueError
            As for `newton`.

        """
        x = self.newton(alpha, guess, **stop)
        found = (
            np.array([self.f(alpha, row) for row in x]),
            np.array([self.phi(alpha, row) for row in x]),
        )
        for array in (x, *found):
            array.setflags(write=False)
        units = tuple(body.unit for body in self.linkage.structure.bodies[1:])
        return Iterations(crank_angle(alpha), self.joint_names[1:], units, x, *found)
