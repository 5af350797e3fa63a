"""
The linkage challenge of MIT 2.155/2.156: six egg-shaped curves, by linkages of little material.

    python benchmarks/linkage_challenge.py CURVES.npy [SUBMISSION.npy] [MINUTES]

CURVES.npy and the grader are those of the challenge's public repository, neither of which is
copied here; the grader reads SUBMISSION.npy. Its score of a curve is the area that the linkages
dominate up to a distance of 0.75 and a material of 10, twice the sum of their bars; the mean of
six counts, of at most 7.5. The best public submission found has 4.089, the challenge's own start
1.34. Every structure of few dyads is searched by NSGA-II (pymoo) on the bulk solver; the better
third of them goes on with twice the generations. MINUTES are of one CPU.
"""

from collections.abc import Iterator, Sequence
from functools import cached_property
from itertools import combinations, permutations
import sys
import time
from typing import Any, NamedTuple

from klann_ros.design.target import Target
from klann_ros.kinematics import Linkage, Variants
from klann_ros.kinematics.arrays import ComplexArray, FloatArray
from klann_ros.kinematics.batch.turns import whole_turns
from klann_ros.kinematics.linkage.structure import Bar, Body, Structure
import numpy as np
from pymoo.algorithms.moo.nsga2 import NSGA2
from pymoo.core.problem import Problem
from pymoo.indicators.hv import HV
from pymoo.optimize import minimize
from support.aims import exit_code, sized, SMOKE

# The reference point of the score, and the most linkages that count for a curve.
MAX_DISTANCE, MAX_MATERIAL, MAX_LINKAGES = 0.75, 10.0, 1000
AIM, BEST_FOUND, CEILING = 4.5, 4.089, 7.5
# Points of a turn and of a curve in the grader, whose turn ends where it starts.
TURN_POINTS, CURVE_POINTS = 199, 200
DYADS, PIVOTS = sized(2, 3), sized(1, 2)
POPULATION, SAMPLES, GENERATIONS = sized(40, 100), sized(200, 4000), sized(5, 30)
ROUNDS, KEPT, FINALISTS = sized(1, 4), 1.0 / 3.0, 3
# Joints are within this distance of the crank's axle along each axis; curves are 0.4 wide.
REACH = 0.8
# The grader computes in single precision: links stay this far from being in line [rad].
MIN_TRANSMISSION_ANGLE = np.radians(2.0)


class Chain(NamedTuple):
    """Joints: the axle 0, the crank's 1, more pivots, then one a dyad, bound to two before it."""

    pivots: int
    dyads: tuple[tuple[int, int], ...]

    @property
    def joints(self) -> int:
        """Return the number of joints."""
        return 2 + self.pivots + len(self.dyads)

    @property
    def edges(self) -> list[tuple[int, int]]:
        """Return the bars by their joints, the crank first."""
        first = 2 + self.pivots
        ends = [(one, n) for n, pair in enumerate(self.dyads, start=first) for one in pair]
        return [(0, 1), *ends]


def chains(dyads: int, pivots: int) -> list[Chain]:
    """Return the chains whose last joint moves by all others, each once."""
    found: dict[tuple[int, Any], Chain] = {}
    for count in range(2, dyads + 1):
        for more in range(1, min(pivots, count) + 1):
            for pairs in _pairs(2 + more, count):
                chain = Chain(more, pairs)
                if _is_whole(chain):
                    found.setdefault((more, _canonical(chain)), chain)
    return [*found.values()]


def _pairs(known: int, count: int) -> Iterator[tuple[tuple[int, int], ...]]:
    if count == 0:
        yield ()
        return
    for pair in combinations(range(known), 2):
        for rest in _pairs(known + 1, count - 1):
            yield (pair, *rest)


def _is_whole(chain: Chain) -> bool:
    fixed = {0, *range(2, 2 + chain.pivots)}
    used = {joint for pair in chain.dyads for joint in pair}
    # A joint bound to two pivots stands still, one bound to the crank's bar is a part of it, and
    # the last one must not be on a circle.
    moves = all(not {*pair} <= fixed and {*pair} != {0, 1} for pair in chain.dyads)
    return moves and not {*chain.dyads[-1]} & fixed and {*range(1, chain.joints - 1)} <= used


def _canonical(chain: Chain) -> Any:
    """Return the least of the names of a chain, whose pivots and inner joints may be permuted."""
    first, last = 2 + chain.pivots, chain.joints - 1
    names = []
    for pivots in permutations(range(2, first)):
        for inner in permutations(range(first, last)):
            new = [0, 1, *pivots, *inner, last]
            names.append(sorted(tuple(sorted((new[a], new[b]))) for a, b in chain.edges))
    return tuple(min(names))


class ChainSearch(Problem):  # type: ignore[misc]  # pymoo has no types
    """A chain and a curve: distance and material by the positions of the joints at one angle."""

    def __init__(self, chain: Chain, curve: ComplexArray) -> None:
        """Fix the axle at the origin and the second pivot on the x axis."""
        self.chain, self.target = chain, Target(curve, can_scale=False)
        super().__init__(n_var=2 * chain.joints - 3, n_obj=2, n_ieq_constr=1, xl=-REACH, xu=REACH)
        self.radius = float(np.sqrt((np.abs(curve - curve.mean()) ** 2).mean()))
        self.best: list[tuple[FloatArray, FloatArray]] = []
        self.population: FloatArray | None = None

    @cached_property
    def linkage(self) -> Linkage:
        """Return the linkage, whose numbers mean nothing yet."""
        bodies = [
            Body(f'bar_{one}_{other}', (Bar(f'J{one}', f'J{other}'),))
            for one, other in self.chain.edges
        ]
        pivots = [f'J{n}' for n in (0, *range(2, 2 + self.chain.pivots))]
        structure = Structure(tuple(pivots), tuple(bodies), f'J{self.chain.joints - 1}')
        ones = [float(d.is_length) for d in structure.dimensions]
        return Linkage(structure, ones, assembly=(1,) * len(self.chain.dyads))

    def positions(self, x: FloatArray) -> ComplexArray:
        """Return the positions of the joints, shape (n, number of joints)."""
        axle, second = np.zeros((len(x), 2)), np.column_stack([x[:, 2], np.zeros(len(x))])
        every = np.hstack([axle, x[:, :2], second, x[:, 3:]])
        z = every.reshape(len(x), -1, 2) @ np.array([1.0, 1j])
        return np.asarray(z, dtype=np.complex128)

    def variants(self, z: ComplexArray) -> Variants:
        """Return the linkages with joints at these positions."""
        structure, steps = self.linkage.structure, []
        for _, bar in structure.bars:
            steps.append(z[:, int(bar.end[1:])] - z[:, int(bar.start[1:])])
        changes: dict[str, FloatArray] = {}
        for d in structure.dimensions:
            if d.kind == 'length':
                changes[d.name] = np.abs(steps[d.place])
            elif d.kind in 'xy':
                at = z[:, int(structure.pivots[d.place][1:])]
                changes[d.name] = at.real if d.kind == 'x' else at.imag
        modes = [np.sign((np.conj(steps[a]) * steps[b]).imag) for a, b in structure.groups]
        return Variants(self.linkage, changes, assembly=np.array(modes))

    def _evaluate(self, x: FloatArray, out: dict[str, Any], *_: Any, **__: Any) -> None:
        variants = self.variants(self.positions(x))
        turns = whole_turns(variants, TURN_POINTS)
        # The grader counts a bar from each of its ends.
        material = 2.0 * sum(
            variants.numbers[k]
            for k, d in enumerate(self.linkage.structure.dimensions)
            if d.kind == 'length'
        )
        distance = np.full(len(x), 10.0)
        fine = np.flatnonzero(turns.missing == 0.0)
        # The rms distance, which is no less than the grader's mean distance.
        error = self.target.fit(turns.h[:, fine].transpose(1, 2, 0)).error
        distance[fine] = 2.0 * np.pi * error / self.radius
        lacking = np.maximum(0.0, MIN_TRANSMISSION_ANGLE - np.nan_to_num(turns.transmission_angle))
        beyond = np.maximum(0.0, distance - MAX_DISTANCE)
        beyond += np.maximum(0.0, material - MAX_MATERIAL)
        out['F'] = np.column_stack([distance, material])
        out['G'] = np.where(turns.missing == 0.0, beyond + lacking, 100.0 + turns.missing)[:, None]

    def sampled(self, random: np.random.Generator) -> FloatArray:
        """Return the best of random candidates."""
        x, out = random.uniform(-REACH, REACH, (SAMPLES, self.n_var)), dict[str, Any]()
        self._evaluate(x, out)
        order = np.lexsort([out['F'][:, 0], out['G'][:, 0]])
        return np.asarray(x[order[:POPULATION]])

    def go_on(self, generations: int, random: np.random.Generator) -> None:
        """Evolve, and keep what is not dominated."""
        x = self.sampled(random) if self.population is None else self.population
        algorithm, seed = NSGA2(pop_size=len(x), sampling=x), int(random.integers(2**31))
        found = minimize(self, algorithm, ('n_gen', generations), seed=seed)
        self.population = np.asarray(found.pop.get('X'), dtype=np.float64)
        losses, limits = found.pop.get('F'), found.pop.get('G')[:, 0]
        fine = limits <= 0.0
        self.best = [*zip(self.population[fine], losses[fine], strict=True)]

    @property
    def score(self) -> float:
        """Return the area that it dominates, by the rms distance."""
        return area(np.array([losses for _, losses in self.best]))


def area(losses: FloatArray) -> float:
    """Return the score of distances and materials, shape (n, 2)."""
    if not len(losses):
        return 0.0
    inside = losses[(losses < (MAX_DISTANCE, MAX_MATERIAL)).all(axis=1)]
    reference = np.array([MAX_DISTANCE, MAX_MATERIAL])
    return float(HV(ref_point=reference)(inside)) if len(inside) else 0.0


def graded(path: ComplexArray, curve: ComplexArray) -> float:
    """Return the grader's distance of a closed path from a curve, which it does not close."""
    w, z = _even(np.append(path, path[0])), _even(curve)
    radius = np.sqrt((np.abs(z) ** 2).mean())
    distances = []
    for own in (w, w[::-1]):
        shifted = np.array([np.roll(own, n) for n in range(CURVE_POINTS)]) / radius
        overlap = (np.conj(shifted) * z / radius).sum(axis=1)
        turned = (overlap / np.abs(overlap))[:, None] * shifted
        distances.append(np.abs(turned - z / radius).mean(axis=1).min())
    return 2.0 * np.pi * float(min(distances))


def _even(z: ComplexArray) -> ComplexArray:
    """Return a polygon at equal steps of its length, about its centre."""
    along = np.append(0.0, np.cumsum(np.abs(np.diff(z))))
    wanted = along[-1] * np.linspace(0.0, 1.0 - 1e-6, CURVE_POINTS)
    even = np.interp(wanted, along, z.real) + 1j * np.interp(wanted, along, z.imag)
    return np.asarray(even - even.mean())


def search_curve(curve: ComplexArray, seconds: float, seed: int) -> list[ChainSearch]:
    """Return the searches of all chains for a curve, the best one first."""
    random, end = np.random.default_rng(seed), time.process_time() + seconds
    every = [ChainSearch(chain, curve) for chain in chains(DYADS, PIVOTS)]
    left, generations = every, GENERATIONS
    for turn in range(ROUNDS):
        for one in left:
            one.go_on(generations, random)
        left = sorted(left, key=lambda one: -one.score)
        left = left[: max(FINALISTS, int(KEPT * len(left)))]
        if turn == 0 and SMOKE:
            return left
        generations *= 2
        if time.process_time() > end:
            break
    while time.process_time() < end:
        for one in left[:FINALISTS]:
            one.go_on(generations, random)
    return sorted(every, key=lambda one: -one.score)


def entries(searches: Sequence[ChainSearch], curve: ComplexArray) -> list[dict[str, Any]]:
    """Return the linkages that no other dominates, as the grader reads them, with their losses."""
    every = sorted(
        (
            (tuple(losses.tolist()), n, x)
            for n, one in enumerate(searches)
            for x, losses in one.best
        ),
        key=lambda item: item[0],
    )
    least, found = np.inf, list[dict[str, Any]]()
    for (_, material), n, x in every:
        if material >= least:
            continue
        least, one = material, searches[n]
        z = one.positions(x[None])
        h = whole_turns(one.variants(z), TURN_POINTS).h[:, 0]
        fixed = [0, *range(2, 2 + one.chain.pivots)]
        found.append(
            {
                'x0': np.column_stack([z[0].real, z[0].imag]),
                'edges': np.array(one.chain.edges),
                'fixed_joints': np.array(fixed),
                'motor': np.array([0, 1]),
                'target_joint': one.chain.joints - 1,
                'losses': (graded(h[0] + 1j * h[1], curve), material),
            }
        )
    chosen = np.linspace(0, len(found) - 1, min(len(found), MAX_LINKAGES)).round().astype(int)
    return [found[k] for k in chosen.tolist()]


def egg() -> FloatArray:
    """Return a curve for the smallest form, shape (1, k, 2)."""
    t = np.linspace(0.0, 2.0 * np.pi, CURVE_POINTS)
    return 0.2 * np.stack([np.cos(t) * (1.0 - 0.2 * np.sin(t)), 1.2 * np.sin(t)], axis=-1)[None]


def main() -> int:
    """Search for linkages of each curve; return 0 if the mean score reaches its aim."""
    names = sys.argv[1:]
    if not names and not SMOKE:
        print('left out without the target_curves.npy of the challenge: see the text of this file')
        return 0
    curves = np.load(names[0]) if names else egg()
    minutes = float(names[2]) if len(names) > 2 else 30.0
    seconds, scores, submission = 60.0 * minutes / len(curves), list[float](), dict[str, Any]()
    for k, points in enumerate(curves):
        curve = points.astype(np.float64) @ np.array([1.0, 1j])
        begin, own = time.perf_counter(), time.process_time()
        searches = search_curve(curve, seconds, k)
        found = entries(searches, curve)
        scores.append(area(np.array([entry.pop('losses') for entry in found]).reshape(-1, 2)))
        submission[f'Problem {k + 1}'] = found
        print(
            f'curve {k + 1}: {scores[-1]:.3f} of {CEILING}, {len(found)} linkages of '
            f'{len(searches)} structures, the best {searches[0].chain.dyads}; '
            f'CPU {time.process_time() - own:.0f} s, {time.perf_counter() - begin:.0f} s',
            flush=True,
        )
    if len(names) > 1:
        np.save(names[1], np.array(submission, dtype=object))
    mean = float(np.mean(scores))
    print(f'mean {mean:.3f}, aim {AIM}; best public submission found {BEST_FOUND}')
    return exit_code(mean >= AIM)


if __name__ == '__main__':
    sys.exit(main())
