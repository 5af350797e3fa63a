"""
The search beside pylinkage's particle swarm and leggedsnake's NSGA-II, on the same problem.

    python benchmarks/optimisers.py [SEEDS]

The task is the foot path of a hidden Jansen leg, each of its 11 lengths within 20 % of the shipped
one, at 96 equal steps of the crank. The other libraries have the defaults of their guides, the
faster of their solvers, and SECONDS of a CPU; the search needs less. All are measured by the same
rms distance. Neither is a dependency: pip install pylinkage leggedsnake.
"""

from contextlib import suppress
from copy import deepcopy
from importlib.util import find_spec
import sys
import time
from typing import Any

from klann_ros.design import refine, requirements_from, search
from klann_ros.design.target import Target
from klann_ros.kinematics import linkage_poses, shipped_linkage, Variants
from klann_ros.kinematics.angles import TURN
from klann_ros.kinematics.arrays import FloatArray
import numpy as np
from support.aims import exit_code, sized, SMOKE

SEEDS = sized(1, 2, 20)
SECONDS = sized(0.2, 8.0)
EVALUATIONS = sized(480, 2000)
if SMOKE:
    refine.MAX_STEPS = 2
FRAMES = 96
SPREAD = 0.2
PARTICLES = 100
JANSEN = shipped_linkage('jansen')
LENGTHS = {name: JANSEN.dimensions[name] for name in JANSEN.dimensions if '-' in name}
MIN_LENGTHS = [(1.0 - SPREAD) * length for length in LENGTHS.values()]
MAX_LENGTHS = [(1.0 + SPREAD) * length for length in LENGTHS.values()]
ALPHAS = TURN / FRAMES * np.arange(1, FRAMES + 1)
# Seed of the hidden legs, beside that of an optimiser.
HIDDEN_SEED = 31
# More iterations than any budget allows.
MAX_ITERATIONS = 10**6


class TimeUpError(BaseException):
    """The budget is spent; no Exception, which leggedsnake takes for a leg that breaks."""


class Attempt:
    """Errors of candidates of another library, until its time is up."""

    def __init__(self, path: FloatArray, seconds: float) -> None:
        """Start the clock."""
        self._path = path
        self._end_time = time.process_time() + seconds
        self._min_rms = np.inf
        # The path of the best candidate so far, and the number of candidates.
        self.best_path = np.zeros((FRAMES, 2))
        self.count = 0

    def error(self, h: FloatArray) -> float:
        """Return the rms distance of a candidate's path, at the same crank angles [m]."""
        if time.process_time() > self._end_time:
            raise TimeUpError
        self.count += 1
        rms = float(np.sqrt(((h - self._path) ** 2).sum(axis=1).mean()))
        if not rms < np.inf:
            return 1e3
        if rms < self._min_rms:
            self._min_rms = rms
            self.best_path = h
        return rms


def draw_path(random: np.random.Generator) -> FloatArray:
    """Return the foot path of a leg that turns, shape (FRAMES, 2)."""
    while True:
        factors = random.uniform(1.0 - SPREAD, 1.0 + SPREAD, len(LENGTHS)).tolist()
        changes = {name: [LENGTHS[name] * factors[k]] for k, name in enumerate(LENGTHS)}
        poses = linkage_poses(Variants(JANSEN, changes), ALPHAS)
        if not poses.reason.any():
            return np.asarray(poses.h[0])


def relative_error(path: FloatArray, h: FloatArray) -> float:
    """Return the error of a path relative to the size of the hidden one."""
    points = np.asarray(path @ np.array([1.0, 1j]), dtype=np.complex128)
    target = Target(points, can_move=False, can_turn=False, can_scale=False, is_timed=True)
    return float(target.fit(h[None]).error[0]) / target.size


def search_jansen(path: FloatArray, seed: int) -> float:
    """Return the error of the search."""
    bounds = map(list, zip(MIN_LENGTHS, MAX_LENGTHS, strict=True))
    requirements = {
        'linkage': 'jansen',
        'vary': dict(zip(LENGTHS, bounds, strict=True)),
        'path': {
            'points': path.tolist(),
            'timing': 'prescribed',
            'move': False,
            'turn': False,
            'scale': False,
        },
        'count': 1,
    }
    legs = search(requirements_from(requirements), seed=seed, evaluations=EVALUATIONS).legs
    if not legs:
        return 1.0
    return relative_error(path, linkage_poses(legs[0].linkage, ALPHAS).h)


def pylinkage_jansen() -> Any:
    """Return Jansen's leg in pylinkage; its constraints are in the order of LENGTHS."""
    from pylinkage.actuators import Crank  # noqa: PLC0415 - no dependency
    from pylinkage.components import Ground  # noqa: PLC0415
    from pylinkage.dyads import RRRDyad  # noqa: PLC0415
    from pylinkage.simulation import Linkage  # noqa: PLC0415

    points: Any = linkage_poses(JANSEN, [0.0], points=True).points
    positions: dict[str, Any] = dict(zip(JANSEN.structure.points, points[0].tolist(), strict=True))
    # Components, and the anchors that they are for others.
    components: dict[str, Any] = {}
    anchors: dict[str, Any] = {}
    for name in 'ZY':
        x, y = positions[name]
        components[name] = anchors[name] = Ground(x, y, name=name)
    crank = Crank(anchors['Z'], radius=LENGTHS['Z-X'], angular_velocity=TURN / FRAMES, name='X')
    components['X'] = crank
    anchors['X'] = crank.output
    for name, parent_p, parent_q in ('WXY', 'VYW', 'UXY', 'TVU', 'SUT'):
        x, y = positions[name]
        components[name] = anchors[name] = RRRDyad(
            anchors[parent_p],
            anchors[parent_q],
            LENGTHS[f'{parent_p}-{name}'],
            LENGTHS[f'{parent_q}-{name}'],
            x=x,
            y=y,
            name=name,
        )
    return Linkage(list(components.values()), name='jansen')


def optimise_by_swarm(path: FloatArray, _: int) -> tuple[float, int]:
    """Return the error of pylinkage's particle swarm, and its number of candidates."""
    from pylinkage.optimization import particle_swarm_optimization  # noqa: PLC0415

    attempt = Attempt(path, SECONDS)
    linkage = pylinkage_jansen()
    start_positions = linkage.get_coords()

    def error(linkage: Any, lengths: Any, *_: Any) -> float:
        linkage.set_coords(start_positions)
        linkage.set_constraints(lengths)
        return attempt.error(linkage.step_fast(FRAMES)[:, -1])

    with suppress(TimeUpError):
        particle_swarm_optimization(
            error,
            linkage,
            n_particles=PARTICLES,
            iterations=MAX_ITERATIONS,
            bounds=(MIN_LENGTHS, MAX_LENGTHS),
            order_relation=min,
            verbose=False,
        )
    return relative_error(path, attempt.best_path), attempt.count


def optimise_by_nsga(path: FloatArray, seed: int) -> tuple[float, int]:
    """Return the error of leggedsnake's NSGA-II, and its number of candidates."""
    from leggedsnake import (  # noqa: PLC0415
        FitnessResult,
        nsga_walking_optimization,
        NsgaWalkingConfig,
        Walker,
    )

    attempt = Attempt(path, SECONDS)
    walker: Any = None
    topology, dimensions = pylinkage_jansen().to_hypergraph()

    def make_walker() -> Any:
        nonlocal walker
        walker = Walker(deepcopy(topology), deepcopy(dimensions))
        return walker

    class PathFitness:
        """The negative error of the path: leggedsnake maximises."""

        def __call__(self, *_: Any) -> Any:
            # The last walker has the candidate's lengths. One that is made of its dimensions has
            # not, as their points are those of the first walker.
            try:
                feet = [pose[-1] for pose in walker.step(FRAMES, skip_unbuildable=True)]
                h = np.array(feet, dtype=np.float64)
            except (TypeError, ValueError):
                h = np.full((FRAMES, 2), np.nan)
            return FitnessResult(score=-attempt.error(h), metrics={}, valid=True)

    config = NsgaWalkingConfig(
        n_generations=MAX_ITERATIONS, pop_size=100, seed=seed, verbose=False
    )
    with suppress(TimeUpError):
        nsga_walking_optimization(
            make_walker, [PathFitness()], (MIN_LENGTHS, MAX_LENGTHS), nsga_config=config
        )
    return relative_error(path, attempt.best_path), attempt.count


def main() -> int:
    """Print the errors of all; return 0 if ours are at most half of the best library's."""
    optimisers = {'pylinkage': optimise_by_swarm, 'leggedsnake': optimise_by_nsga}
    missing = sorted(name for name in optimisers if not find_spec(name))
    if missing:
        print(f'not installed, left out: pip install {" ".join(missing)}')
    for name in missing:
        del optimisers[name]
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else SEEDS
    errors: dict[str, list[float]] = {name: [] for name in ('klann_ros', *optimisers)}
    cpu_times: list[float] = []
    for seed in range(seeds):
        # A stream of its own: the samples of NSGA-II would begin with the hidden leg.
        path = draw_path(np.random.default_rng((HIDDEN_SEED, seed)))
        start_time = time.process_time()
        errors['klann_ros'].append(search_jansen(path, seed))
        cpu_times.append(time.process_time() - start_time)
        line = f'{seed:2}: {100.0 * errors["klann_ros"][-1]:.4f} % in {cpu_times[-1]:.1f} s'
        for name, optimise in optimisers.items():
            error, count = optimise(path, seed)
            errors[name].append(error)
            line += f', {name} {100.0 * error:.4f} % ({count} candidates)'
        print(line, flush=True)
    medians = {name: 100.0 * float(np.median(errors[name])) for name in errors}
    median_time = float(np.median(cpu_times))
    print(', '.join(f'{name} {median:.4f} %' for name, median in medians.items()), end=': ')
    print(f'median errors of {seeds} legs; CPU: {median_time:.1f} s, others {SECONDS:g} s')
    our_error = medians.pop('klann_ros')
    best = min(medians.values(), default=np.inf)
    print(f'relative to the best of the others: {our_error / best:.3g}, aim 0.5')
    return exit_code(bool(medians) and our_error <= 0.5 * best, median_time <= SECONDS)


if __name__ == '__main__':
    sys.exit(main())
