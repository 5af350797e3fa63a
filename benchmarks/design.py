"""
The search for legs: speed of judging, proof of many legs, paths that it should recover.

Recovery: the foot path of a hidden Klann leg, each dimension within 20 % of the shipped one, in
the frame of the leg. Jansen: his own path at 180 equal steps of the crank, each of his 13 lengths
free within 50 %, which a published comparison leaves open. Its medians of the RMSE after 100,000
evaluations are 1.08 (annealing), 3.68 (gradient) and 12.76 (genetic), in his units.

    python benchmarks/design.py [poses|proof|recovery|jansen ...] [--full]
"""

from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
import resource
import sys
import tempfile
import time
from typing import NamedTuple

from klann_ros.design import refine, requirements_from, search
from klann_ros.design.figures import CANDIDATE_ANGLES, judge
from klann_ros.design.leg_file import leg_text, with_numbers
from klann_ros.kinematics import (
    GeometryError,
    linkage_poses,
    shipped_linkage,
    turns_fully,
    Variants,
)
from klann_ros.kinematics.angles import TURN
from klann_ros.robot import robot_of
import numpy as np
from support.aims import exit_code, sized, SMOKE

# Judging: poses, legs that are judged at once, processes.
POSES = sized(10**5, 10**8, 10**9)
CHUNK = sized(256, 4096)
CORES = 2
# Proof: legs, and angles of each.
LEGS = sized(3, 1000, 10_000)
ANGLES = sized(1000, 10_000, 100_000)
# Recovery: hidden legs, and evaluations of each search.
CASES = sized(1, 5, 100)
CASE_EVALUATIONS = sized(480, 8000)
# Jansen's path: seeds, and evaluations of each search.
SEEDS = sized(1, 1, 5)
EVALUATIONS = sized(480, 50_000, 100_000)
if SMOKE:
    refine.MAX_STEPS = 2
FIGURES = frozenset({'stride', 'lift', 'duty_factor', 'deviation', 'transmission_angle'})
FIXED = {'move': False, 'turn': False, 'scale': False}


def random_legs(name: str, spread: float, count: int, random: np.random.Generator) -> Variants:
    """Return legs whose dimensions differ from the shipped ones by up to a fraction."""
    linkage = shipped_linkage(name)
    changes = {}
    for dimension, length in linkage.dimensions.items():
        factors = random.uniform(1.0 - spread, 1.0 + spread, count)
        changes[dimension] = length * factors
    return Variants(linkage, changes)


class Workload(NamedTuple):
    """Judged legs, those that turn, time on the CPU [s] and memory [GB] of a process."""

    legs: int
    turning: int
    seconds: float
    memory: float


def judge_legs(seed: int) -> Workload:
    """Judge the poses of a process."""
    random = np.random.default_rng(seed)
    judge(random_legs('klann', 0.2, CHUNK, random), FIGURES)
    start_time = time.process_time()
    legs = 0
    turning = 0
    while legs * CANDIDATE_ANGLES < POSES / CORES:
        figures = judge(random_legs('klann', 0.2, CHUNK, random), FIGURES)
        turning += int(figures.turns.sum())
        legs += CHUNK
    seconds = time.process_time() - start_time
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    return Workload(legs, turning, seconds, memory)


def poses() -> bool:
    """Judge poses by path figures, transmission angle and turning, on two cores."""
    start_time = time.perf_counter()
    with ProcessPoolExecutor(CORES) as pool:
        workloads = [*pool.map(judge_legs, range(CORES))]
    legs, turning, cpu_time, memory = np.sum(workloads, axis=0).tolist()
    pose_count = legs * CANDIDATE_ANGLES
    longest = max(workload.seconds for workload in workloads)
    print(
        f'{pose_count:.3g} poses of {legs:.0f} legs, {100.0 * turning / legs:.0f} % turn: '
        f'{longest:.1f} s of the CPU on each of {CORES} cores '
        f'({1e9 * cpu_time / pose_count:.0f} ns a pose), '
        f'{time.perf_counter() - start_time:.1f} s in all, memory {memory:.2f} GB; '
        'aim 60 s for 1e9, below 1 GB'
    )
    return bool(longest <= 60.0 * POSES / 1e9 and memory < 1.0)


def proof() -> bool:
    """Solve legs that the search takes as turning at many angles; none may jam or jump."""
    random = np.random.default_rng(2)
    checked = jammed = jumped = refused = 0
    alphas = np.linspace(0.0, TURN, ANGLES)
    while checked < LEGS:
        legs = random_legs('klann', 0.2, CHUNK, random)
        for i in np.flatnonzero(judge(legs, frozenset()).turns).tolist():
            if checked == LEGS:
                break
            leg = legs[i]
            if not turns_fully(leg):
                # The proof of the search drops it.
                refused += 1
                continue
            leg_poses = linkage_poses(leg, alphas)
            steps = np.linalg.norm(np.diff(leg_poses.h, axis=0), axis=1)
            jammed += bool(leg_poses.reason.any())
            # A change of branch moves the foot by a part of the leg at once.
            jumped += bool(steps.max() > 0.1 * leg.size)
            checked += 1
    print(
        f'{checked} legs at {ANGLES} angles: {jammed} jam, {jumped} change branch, aim 0 and 0; '
        f'the proof refuses {refused} more that turn at all {CANDIDATE_ANGLES} angles'
    )
    return jammed == jumped == 0


def recovery() -> bool:
    """Recover the foot paths of hidden Klann legs."""
    random = np.random.default_rng(3)
    errors: list[float] = []
    seconds: list[float] = []
    alphas = np.arange(360) * (TURN / 360)
    while len(errors) < CASES:
        hidden_poses = linkage_poses(random_legs('klann', 0.2, 1, random), alphas)
        if hidden_poses.reason.any():
            continue
        path = {'points': hidden_poses.h[0].tolist(), **FIXED}
        requirements = requirements_from(
            {'linkage': 'klann', 'vary': 20, 'path': path, 'count': 1}
        )
        start_time = time.perf_counter()
        legs = search(requirements, evaluations=CASE_EVALUATIONS).legs
        seconds.append(time.perf_counter() - start_time)
        size = requirements.target.size if requirements.target else 1.0
        errors.append(min((leg.reached['path_error'] / size for leg in legs), default=1.0))
        print(f'  {100.0 * errors[-1]:.4f} % of the size, {seconds[-1]:.1f} s', flush=True)
    recovered = sum(error <= 1e-3 for error in errors)
    median = 100.0 * float(np.median(errors))
    print(f'recovered within 0.1 %: {recovered} of {CASES}, aim 95 of 100; median {median:.4f} %')
    print(f'time: median {np.median(seconds):.1f} s, greatest {max(seconds):.1f} s, aim 30 s')
    return recovered >= 0.95 * CASES


def write_jansen_variant(seed: int) -> str:
    """Return the file of a leg of his structure: the search must not begin with the answer."""
    (leg,) = robot_of('jansen').legs
    random = np.random.default_rng(seed)
    while True:
        dimensions = leg.linkage.dimensions
        changes = {name: dimensions[name] * random.uniform(0.6, 1.4) for name in dimensions}
        try:
            text = leg_text(with_numbers(leg, leg.linkage.varied(changes)))
        except GeometryError:
            continue
        with tempfile.NamedTemporaryFile('w', suffix='.yaml', delete=False) as file:
            file.write(text)
        return file.name


def jansen() -> bool:
    """Follow Jansen's path with the lengths of his leg, by 100,000 evaluations."""
    drawn = shipped_linkage('jansen')
    errors: list[float] = []
    path = linkage_poses(drawn, np.arange(180) * (TURN / 180)).h
    vary = {}
    for name, length in drawn.dimensions.items():
        if length:
            vary[name] = sorted([0.5 * length, 1.5 * length])
    for seed in range(SEEDS):
        tables = {'linkage': write_jansen_variant(seed), 'vary': vary, 'count': 1}
        tables['path'] = {'points': path.tolist(), 'timing': 'prescribed', **FIXED}
        legs = search(requirements_from(tables), seed=seed, evaluations=EVALUATIONS).legs
        # His units are centimetres here.
        errors.append(min((100.0 * leg.reached['path_error'] for leg in legs), default=np.inf))
        print(f'  RMSE {errors[-1]:.4g}', flush=True)
    median = float(np.median(errors))
    print(f'Jansen, {EVALUATIONS} evaluations, {SEEDS} seeds: median RMSE {median:.4g}, aim 0.3')
    return median <= 0.3


PARTS: dict[str, Callable[[], bool]] = {
    'poses': poses,
    'proof': proof,
    'recovery': recovery,
    'jansen': jansen,
}


def main() -> int:
    """Run the named parts, all by default; return 0 if they reach their aims."""
    names = [name for name in sys.argv[1:] if name in PARTS] or [*PARTS]
    return exit_code(*[PARTS[name]() for name in names])


if __name__ == '__main__':
    sys.exit(main())
