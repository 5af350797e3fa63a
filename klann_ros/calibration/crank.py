"""
The crank's motion between the samples of its encoder: a smoothing spline with its covariance.

The angle x(t) is a Gaussian process whose third derivative is white noise of the spectral density
q, and the encoder adds noise of the variance r. Its mean is a quintic smoothing spline (G. Wahba,
Spline Models for Observational Data, 1990); q and r are those of the largest likelihood. On a grid
of nodes the states s = (x, x', x'') are a Markov chain,

    s[j + 1] = A s[j] + w,    cov(w) = q Q,

so their information matrix is banded. The nodes are closer than the samples, so that between two
of them x is the Hermite polynomial of their states. The unit of time is the distance of the nodes.
"""

from copy import copy
from functools import cached_property
from math import log
from typing import Any

from klann_ros.kinematics.arrays import BoolArray, FloatArray, IndexArray
import numpy as np

# A crank sample that is further away than this times the usual period is a gap.
MAX_GAP_PERIODS = 5.0
# Consecutive samples are at most this far apart [rad]: beyond, their turns are ambiguous.
MAX_CRANK_STEP = 2.0
# Nodes in a period of the encoder, nodes beyond each end of a stretch, and nodes at most.
NODES_PER_PERIOD = 2
MARGIN_NODES = 4
MAX_NODES = 20_000
# States of a node; A, and the Cholesky factor of Q^-1.
ORDER = 3
TRANSITION = np.array([[1.0, 1.0, 0.5], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]])
STEP_NOISE = np.array([[1 / 20, 1 / 8, 1 / 6], [1 / 8, 1 / 3, 1 / 2], [1 / 6, 1 / 2, 1.0]])
STEP_ROOT = np.linalg.cholesky(np.linalg.inv(STEP_NOISE))
# Hermite polynomials of the states of both nodes, by powers of the fraction.
_STATES_AT_END = np.array([[1, 1, 1, 1, 1, 1], [0, 1, 2, 3, 4, 5], [0, 0, 2, 6, 12, 20]])
_STATES_AT_START = np.diag([1.0, 1.0, 2.0]) @ np.eye(ORDER, 2 * ORDER)
HERMITE = np.linalg.inv(np.vstack([_STATES_AT_START, _STATES_AT_END])).T
# Ratios r / q that are tried, up to which deviance they are likely, and the least q [rad^2].
NOISE_RATIOS = 10.0 ** np.arange(-6.0, 10.0)
LIKELY_DEVIANCE = 20.0
MIN_VARIANCE = 1e-18
# Random motions that sample the covariance.
SAMPLE_COUNT = 64


class CrankSpline:
    """
    The motion of a crank by samples at rising times [s] and positions [rad], shape (n,).

    `noise` is the standard deviation of the samples [rad]; None estimates it. `likely` are the
    motions with another noise that the samples allow.
    """

    period: float  # usual time between samples [s]
    deviance: float  # -2 times the logarithm of the likelihood
    noise: float  # sqrt(r) [rad]
    states: FloatArray  # means of the states
    factor: FloatArray  # Cholesky factor of the information of the states, in banded form
    likely: tuple['CrankSpline', ...] = ()

    def __init__(
        self, times: FloatArray, positions: FloatArray, noise: float | None = None
    ) -> None:
        steps = np.diff(times)
        self.period = float(np.median(steps)) if len(steps) else 0.0
        is_gap = steps > MAX_GAP_PERIODS * self.period
        is_gap |= np.abs(np.diff(positions)) > MAX_CRANK_STEP
        stretches = np.split(np.arange(len(times)), np.flatnonzero(is_gap) + 1)
        stretches = [stretch for stretch in stretches if len(stretch) > ORDER]
        self.starts: FloatArray = np.array([times[stretch[0]] for stretch in stretches])
        self.ends: FloatArray = np.array([times[stretch[-1]] for stretch in stretches])
        duration = float((self.ends - self.starts).sum())
        self._step = max(self.period / NODES_PER_PERIOD, duration / MAX_NODES)
        counts = np.ceil((self.ends - self.starts) / self._step).astype(int) + 2 * MARGIN_NODES
        # Index of the first node of each stretch, and of the one after the last.
        self._nodes: IndexArray = np.concatenate([[0], np.cumsum(counts)])
        if not stretches:
            return
        samples = np.concatenate(stretches)
        self._fit(times[samples], positions[samples], noise)

    def _fit(self, times: FloatArray, positions: FloatArray, noise: float | None) -> None:
        """Set states, q, r and information to those of the largest likelihood."""
        from scipy.sparse import block_diag, csr_array, eye, kron  # noqa: PLC0415 - an extra

        weights, _ = self.weights(times)
        chains = []
        for count in np.diff(self._nodes):
            identity = csr_array(eye(count))
            steps = kron(identity[:-1], STEP_ROOT.T @ TRANSITION)
            chains.append(kron(identity[1:], STEP_ROOT.T) - steps)
        chain = block_diag(chains, format='csr')
        chain_information = chain.T @ chain
        # The likelihood of the motion about a straight one, for the digits.
        line = np.polynomial.Polynomial.fit(times, positions, 1)(times)
        freedom = len(times) - ORDER * len(self.starts)
        motions: list[CrankSpline] = []
        for ratio in NOISE_RATIOS[:1] if noise == 0.0 else NOISE_RATIOS:
            factor = banded_factor(chain_information + weights.T @ weights / ratio)
            states = solved(factor, weights.T @ (positions - line) / ratio)
            residuals = positions - line - weights @ states
            square = float(residuals @ residuals / ratio + np.sum((chain @ states) ** 2))
            density = noise**2 / ratio if noise else max(square / freedom, MIN_VARIANCE)
            determinant = 2.0 * np.log(factor[0]).sum() + len(times) * log(ratio)
            motion = copy(self)
            motion.deviance = freedom * log(density) + square / density + determinant
            motion.noise = (ratio * density) ** 0.5
            motion.factor = factor / density**0.5
            motion.states = solved(factor, weights.T @ positions / ratio)
            motions.append(motion)
        vars(self).update(vars(min(motions, key=lambda motion: motion.deviance)))
        max_deviance = self.deviance + LIKELY_DEVIANCE
        self.likely = tuple(motion for motion in motions if motion.deviance <= max_deviance)

    def weights(self, times: FloatArray) -> tuple[Any, Any]:
        """Return the weights of angles and rates [1/s] at times [s] on the states, sparse."""
        from scipy.sparse import csr_array  # noqa: PLC0415

        # The nearest stretch, which is extrapolated where the crank is unknown.
        stretch = np.searchsorted((self.ends[:-1] + self.starts[1:]) / 2.0, times)
        stretch = np.minimum(stretch, len(self.starts) - 1)
        place = (times - self.starts[stretch]) / self._step + MARGIN_NODES
        first_nodes = self._nodes[stretch]
        last = self._nodes[stretch + 1] - first_nodes - 2
        node = np.clip(np.floor(np.nan_to_num(place)), 0, last)
        powers = (place - node).clip(0.0, 1.0)[:, None] ** np.arange(2 * ORDER)
        slopes = np.arange(2 * ORDER) * np.roll(powers, 1, axis=1) / self._step
        columns = ORDER * (first_nodes + node.astype(int))[:, None] + np.arange(2 * ORDER)
        shape = len(times), ORDER * int(self._nodes[-1])
        pointers = np.arange(0, columns.size + 1, 2 * ORDER)
        angle = csr_array(((powers @ HERMITE.T).ravel(), columns.ravel(), pointers), shape)
        rate = csr_array(((slopes @ HERMITE.T).ravel(), columns.ravel(), pointers), shape)
        return angle, rate

    def at(self, times: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return positions [rad] and rates [rad/s] at times [s], shape (n,)."""
        angle, rate = self.weights(times)
        return angle @ self.states, rate @ self.states

    def variances(self, times: FloatArray) -> FloatArray:
        """Return the variances of the angles at times [s], by random motions [rad^2]."""
        return np.asarray(np.mean((self.weights(times)[0] @ self._random_states) ** 2, axis=1))

    def knows(self, times: FloatArray) -> BoolArray:
        """Return which times are in no gap, and at most a period beyond the ends."""
        is_known: BoolArray = np.zeros(len(times), bool)
        # Cameras and encoders do not start and stop together.
        for start, end in zip(self.starts - self.period, self.ends + self.period, strict=True):
            is_known |= (times >= start) & (times <= end)
        return is_known

    @cached_property
    def _random_states(self) -> FloatArray:
        return random_states(self.factor)

    @property
    def state_times(self) -> FloatArray:
        """Return the time of each state of the chain [s]."""
        times = []
        for start, count in zip(self.starts, np.diff(self._nodes), strict=True):
            times.append(start + self._step * (np.arange(count) - MARGIN_NODES))
        return np.repeat(np.concatenate(times), ORDER)


class CrankWhitening:
    """
    Whitens numbers whose errors are 1 and the error e of a crank's motion times slopes v.

    Their covariance is 1 + v K v^T. Instead of its root numbers b become

        b - v e(b),    L^T e(b),

    with the motion e(b) that fits b best; L L^T is the information of the motion. Their square is
    that of the whitened numbers.
    """

    def __init__(self, motion: CrankSpline, times: FloatArray, slopes: FloatArray) -> None:
        from scipy.sparse import dia_array  # noqa: PLC0415

        width, count = motion.factor.shape
        self._root = dia_array((motion.factor, -np.arange(width)), shape=(count, count)).T
        diagonal = dia_array((slopes[None], [0]), shape=(len(slopes), len(slopes)))
        self._by_states = diagonal @ motion.weights(times)[0]
        information = self._root.T @ self._root + self._by_states.T @ self._by_states
        self._factor = banded_factor(information)

    def __call__(self, columns: FloatArray) -> FloatArray:
        """Return columns of whitened numbers, shape (n + states, m)."""
        motions = solved(self._factor, self._by_states.T @ columns)
        return np.vstack([columns - self._by_states @ motions, self._root @ motions])

    def variances(self) -> FloatArray:
        """Return the variances of v e after the numbers are known, shape (n,)."""
        return np.asarray(np.mean((self._by_states @ random_states(self._factor)) ** 2, axis=1))

    @property
    def log_determinant(self) -> float:
        """Return the logarithm of the determinant of 1 + v K v^T."""
        return 2.0 * float(np.log(self._factor[0]).sum() - np.log(self._root.data[0]).sum())


def banded_factor(information: Any) -> FloatArray:
    """Return the Cholesky factor of a sparse information matrix of a chain, in banded form."""
    from scipy.linalg import cholesky_banded  # noqa: PLC0415

    banded = np.zeros((2 * ORDER, information.shape[0]))
    for n in range(2 * ORDER):
        banded[n, : banded.shape[1] - n] = information.diagonal(-n)
    return np.asarray(cholesky_banded(banded, lower=True, overwrite_ab=True))


def solved(factor: FloatArray, columns: FloatArray) -> FloatArray:
    """Return the states of an information matrix with a banded factor."""
    from scipy.linalg import cho_solve_banded  # noqa: PLC0415

    return np.asarray(cho_solve_banded((factor, True), columns))


def random_states(factor: FloatArray) -> FloatArray:
    """Return random states by the banded factor of their information, shape (states, many)."""
    from scipy.linalg.lapack import dtbtrs  # noqa: PLC0415

    numbers = np.random.default_rng(0).standard_normal((factor.shape[1], SAMPLE_COUNT))
    states, _ = dtbtrs(factor, numbers, uplo='L', trans='T')
    return np.asarray(states)
