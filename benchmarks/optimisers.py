"""
The search beside pylinkage's particle swarm and leggedsnake's NSGA-II, on the same problem.

    python benchmarks/optimisers.py [SEEDS]

The foot path of a hidden Jansen leg, each of its 11 lengths within 20 % of the shipped one, is to
be found within these ranges, at 96 equal steps of the crank. The others have the defaults of their
guides, the faster of their solvers, and SECONDS of a CPU; the search needs less. All are measured
by the same rms distance. Neither is a dependency: pip install pylinkage leggedsnake.
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

SEEDS, SECONDS, EVALUATIONS = sized(1, 2, 20), sized(0.2, 8.0), sized(480, 2000)
if SMOKE:
    refine.MAX_STEPS = 2
FRAMES, SPREAD, PARTICLES = 96, 0.2, 100
JANSEN = shipped_linkage('jansen')
LENGTHS = [name for name in JANSEN.dimensions if '-' in name]
OWN = np.array([JANSEN.dimensions[name] for name in LENGTHS])
ALPHAS = TURN / FRAMES * np.arange(1, FRAMES + 1)
# Beside the seed of an optimiser; more than any budget allows.
HIDDEN, ENDLESS = 31, 10**6


class TimeUpError(BaseException):
    """The budget is spent; no Exception, which leggedsnake takes for a leg that breaks."""


class Attempt:
    """Errors of candidates of another library, until its time is up."""

    def __init__(self, path: FloatArray, seconds: float) -> None:
        """Begin."""
        self._path, self._end = path, time.process_time() + seconds
        self.least, self.best, self.count = np.inf, np.zeros((FRAMES, 2)), 0

    def error(self, h: FloatArray) -> float:
        """Return the rms distance of a candidate's path, at the same crank angles [m]."""
        if time.process_time() > self._end:
            raise TimeUpError
        self.count += 1
        rms = float(np.sqrt(((h - self._path) ** 2).sum(axis=1).mean()))
        if not rms < np.inf:
            return 1e3
        if rms < self.least:
            self.least, self.best = rms, h
        return rms


def hidden(random: np.random.Generator) -> FloatArray:
    """Return the foot path of a leg that turns, shape (FRAMES, 2)."""
    while True:
        factors = random.uniform(1.0 - SPREAD, 1.0 + SPREAD, len(OWN))
        changes = {name: [value] for name, value in zip(LENGTHS, OWN * factors, strict=True)}
        found = linkage_poses(Variants(JANSEN, changes), ALPHAS)
        if not found.reason.any():
            return np.asarray(found.h[0])


def measured(path: FloatArray, h: FloatArray) -> float:
    """Return the error of a path relative to the size of the hidden one."""
    points = np.asarray(path @ np.array([1.0, 1j]), dtype=np.complex128)
    target = Target(points, can_move=False, can_turn=False, can_scale=False, is_timed=True)
    return float(target.fit(h[None]).error[0]) / target.size


def ours(path: FloatArray, seed: int) -> float:
    """Return the error of the search."""
    vary = {
        name: [(1.0 - SPREAD) * own, (1.0 + SPREAD) * own]
        for name, own in zip(LENGTHS, OWN.tolist(), strict=True)
    }
    fixed = {'timing': 'prescribed', 'move': False, 'turn': False, 'scale': False}
    content = {'linkage': 'jansen', 'vary': vary, 'path': {'points': path.tolist(), **fixed}}
    found = search(requirements_from({**content, 'count': 1}), seed=seed, evaluations=EVALUATIONS)
    if not found.legs:
        return 1.0
    return measured(path, linkage_poses(found.legs[0].linkage, ALPHAS).h)


def pylinkage_jansen() -> Any:
    """Return Jansen's leg in pylinkage; its constraints are in the order of LENGTHS."""
    from pylinkage.actuators import Crank  # noqa: PLC0415 - no dependency
    from pylinkage.components import Ground  # noqa: PLC0415
    from pylinkage.dyads import RRRDyad  # noqa: PLC0415
    from pylinkage.simulation import Linkage  # noqa: PLC0415

    points: Any = linkage_poses(JANSEN, [0.0], points=True).points
    at: dict[str, Any] = dict(zip(JANSEN.structure.points, points[0].tolist(), strict=True))
    own = dict(zip(LENGTHS, OWN.tolist(), strict=True))
    ground = {name: Ground(at[name][0], at[name][1], name=name) for name in 'ZY'}
    crank = Crank(ground['Z'], radius=own['Z-X'], angular_velocity=TURN / FRAMES, name='X')
    made: dict[str, Any] = {**ground, 'X': crank}
    for name, one, other in ('WXY', 'VYW', 'UXY', 'TVU', 'SUT'):
        p, q = (crank.output if parent == 'X' else made[parent] for parent in (one, other))
        r_p, r_q = own[f'{one}-{name}'], own[f'{other}-{name}']
        x, y = at[name]
        made[name] = RRRDyad(p, q, r_p, r_q, x=x, y=y, name=name)
    return Linkage(list(made.values()), name='jansen')


def swarm(path: FloatArray, _: int) -> tuple[float, int]:
    """Return the error of pylinkage's particle swarm, and its number of candidates."""
    from pylinkage.optimization import particle_swarm_optimization  # noqa: PLC0415

    attempt, linkage = Attempt(path, SECONDS), pylinkage_jansen()
    start = linkage.get_coords()

    def error(linkage: Any, lengths: Any, *_: Any) -> float:
        linkage.set_coords(start)
        linkage.set_constraints(lengths)
        return attempt.error(linkage.step_fast(FRAMES)[:, -1])

    bounds = ((1.0 - SPREAD) * OWN).tolist(), ((1.0 + SPREAD) * OWN).tolist()
    with suppress(TimeUpError):
        particle_swarm_optimization(
            error,
            linkage,
            n_particles=PARTICLES,
            iterations=ENDLESS,
            bounds=bounds,
            order_relation=min,
            verbose=False,
        )
    return measured(path, attempt.best), attempt.count


def nsga(path: FloatArray, seed: int) -> tuple[float, int]:
    """Return the error of leggedsnake's NSGA-II, and its number of candidates."""
    from leggedsnake import (  # noqa: PLC0415
        FitnessResult,
        nsga_walking_optimization,
        NsgaWalkingConfig,
        Walker,
    )

    attempt, made = Attempt(path, SECONDS), list[Any]()
    topology, dimensions = pylinkage_jansen().to_hypergraph()

    def walker() -> Any:
        made[:] = [Walker(deepcopy(topology), deepcopy(dimensions))]
        return made[0]

    class PathFitness:
        """The path as leggedsnake has its aims: the greater the better."""

        def __call__(self, *_: Any) -> Any:
            # Of the walker that has the candidate's lengths: one that is made of its dimensions
            # has not, as their points are those of the first one.
            try:
                poses = [pose[-1] for pose in made[0].step(FRAMES, skip_unbuildable=True)]
                h = np.array(poses, dtype=np.float64)
            except (TypeError, ValueError):
                h = np.full((FRAMES, 2), np.nan)
            return FitnessResult(score=-attempt.error(h), metrics={}, valid=True)

    bounds = ((1.0 - SPREAD) * OWN).tolist(), ((1.0 + SPREAD) * OWN).tolist()
    config = NsgaWalkingConfig(n_generations=ENDLESS, pop_size=100, seed=seed, verbose=False)
    with suppress(TimeUpError):
        nsga_walking_optimization(
            walker,
            [PathFitness()],
            bounds,
            nsga_config=config,
        )
    return measured(path, attempt.best), attempt.count


def main() -> int:
    """Print the errors of all; return 0 if ours are at most half of the best of the others'."""
    every = {'pylinkage': swarm, 'leggedsnake': nsga}
    others = {name: run for name, run in every.items() if find_spec(name)}
    if missing := every.keys() - others:
        print(f'not installed, left out: pip install {" ".join(sorted(missing))}')
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else SEEDS
    errors: dict[str, list[float]] = {'klann_ros': [], **{name: [] for name in others}}
    spent = list[float]()
    for seed in range(seeds):
        # A stream of its own: the samples of NSGA-II would begin with the hidden leg.
        path = hidden(np.random.default_rng((HIDDEN, seed)))
        begin = time.process_time()
        errors['klann_ros'].append(ours(path, seed))
        spent.append(time.process_time() - begin)
        line = f'{seed:2}: {100.0 * errors["klann_ros"][-1]:.4f} % in {spent[-1]:.1f} s'
        for name, run in others.items():
            error, count = run(path, seed)
            errors[name].append(error)
            line += f', {name} {100.0 * error:.4f} % ({count} candidates)'
        print(line, flush=True)
    medians = {name: 100.0 * float(np.median(some)) for name, some in errors.items()}
    print(', '.join(f'{name} {median:.4f} %' for name, median in medians.items()), end=': ')
    print(f'median errors of {seeds} legs; CPU: {np.median(spent):.1f} s, others {SECONDS:g} s')
    mine = medians.pop('klann_ros')
    best = min(medians.values(), default=np.inf)
    print(f'relative to the best of the others: {mine / best:.3g}, aim 0.5')
    return exit_code(bool(medians) and mine <= 0.5 * best, float(np.median(spent)) <= SECONDS)


if __name__ == '__main__':
    sys.exit(main())
