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
MAX_DISTANCE = 0.75
MAX_MATERIAL = 10.0
MAX_LINKAGES = 1000
# Scores.
AIM = 4.5
BEST_PUBLIC = 4.089
CEILING = 7.5
# Points of a turn and of a curve in the grader, whose turn ends where it starts.
TURN_POINTS = 199
CURVE_POINTS = 200
# Largest structures.
DYADS = sized(2, 3)
PIVOTS = sized(1, 2)
POPULATION = sized(40, 100)
SAMPLES = sized(200, 4000)
GENERATIONS = sized(5, 30)
# Rounds, the fraction of structures that each keeps, and their number at the end.
ROUNDS = sized(1, 4)
KEPT = 1.0 / 3.0
FINALISTS = 3
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
        edges = [(0, 1)]
        for joint, ends in enumerate(self.dyads, start=2 + self.pivots):
            edges += [(end, joint) for end in ends]
        return edges


def list_chains(max_dyads: int, max_pivots: int) -> list[Chain]:
    """Return the chains whose last joint moves by all others, each once."""
    chains: dict[tuple[int, Any], Chain] = {}
    for dyads in range(2, max_dyads + 1):
        for pivots in range(1, min(max_pivots, dyads) + 1):
            for ends in _list_ends(2 + pivots, dyads):
                chain = Chain(pivots, ends)
                if _is_whole(chain):
                    chains.setdefault((pivots, _canonical_name(chain)), chain)
    return [*chains.values()]


def _list_ends(joints: int, dyads: int) -> Iterator[tuple[tuple[int, int], ...]]:
    """Yield the possible ends of dyads, the first of which is bound to two of the joints."""
    if dyads == 0:
        yield ()
        return
    for first_ends in combinations(range(joints), 2):
        for later_ends in _list_ends(joints + 1, dyads - 1):
            yield (first_ends, *later_ends)


def _is_whole(chain: Chain) -> bool:
    fixed = {0, *range(2, 2 + chain.pivots)}
    # A joint bound to two pivots stands still, one bound to the crank's bar belongs to it, and
    # the last one must not be on a circle.
    for ends in chain.dyads:
        if {*ends} <= fixed or {*ends} == {0, 1}:
            return False
    moves_freely = not {*chain.dyads[-1]} & fixed
    return moves_freely and {*range(1, chain.joints - 1)} <= {*sum(chain.dyads, ())}


def _canonical_name(chain: Chain) -> Any:
    """Return the first name of a chain, whose pivots and inner joints may be permuted."""
    first_dyad = 2 + chain.pivots
    last = chain.joints - 1
    names = []
    for pivots in permutations(range(2, first_dyad)):
        for inner in permutations(range(first_dyad, last)):
            new = [0, 1, *pivots, *inner, last]
            names.append(sorted(tuple(sorted((new[a], new[b]))) for a, b in chain.edges))
    return tuple(min(names))


class ChainSearch(Problem):  # type: ignore[misc]  # pymoo has no types
    """A chain and a curve: distance and material by the positions of the joints at one angle."""

    def __init__(self, chain: Chain, curve: ComplexArray) -> None:
        """Fix the axle at the origin and the second pivot on the x axis."""
        self.chain = chain
        self.target = Target(curve, can_scale=False)
        super().__init__(n_var=2 * chain.joints - 3, n_obj=2, n_ieq_constr=1, xl=-REACH, xu=REACH)
        self.radius = float(np.sqrt((np.abs(curve - curve.mean()) ** 2).mean()))
        self.best: list[tuple[FloatArray, FloatArray]] = []
        self.population: FloatArray | None = None

    @cached_property
    def linkage(self) -> Linkage:
        """Return the linkage, whose numbers mean nothing yet."""
        bodies = [
            Body(f'bar_{start}_{end}', (Bar(f'J{start}', f'J{end}'),))
            for start, end in self.chain.edges
        ]
        pivots = [f'J{n}' for n in (0, *range(2, 2 + self.chain.pivots))]
        structure = Structure(tuple(pivots), tuple(bodies), f'J{self.chain.joints - 1}')
        numbers = [float(d.is_length) for d in structure.dimensions]
        return Linkage(structure, numbers, assembly=(1,) * len(self.chain.dyads))

    def positions(self, x: FloatArray) -> ComplexArray:
        """Return the positions of the joints, shape (n, number of joints)."""
        axle = np.zeros((len(x), 2))
        second_pivot = np.column_stack([x[:, 2], np.zeros(len(x))])
        coordinates = np.hstack([axle, x[:, :2], second_pivot, x[:, 3:]])
        z = coordinates.reshape(len(x), -1, 2) @ np.array([1.0, 1j])
        return np.asarray(z, dtype=np.complex128)

    def variants(self, z: ComplexArray) -> Variants:
        """Return the linkages with joints at these positions."""
        structure = self.linkage.structure
        bars = []
        for _, bar in structure.bars:
            bars.append(z[:, int(bar.end[1:])] - z[:, int(bar.start[1:])])
        changes: dict[str, FloatArray] = {}
        for d in structure.dimensions:
            if d.kind == 'length':
                changes[d.name] = np.abs(bars[d.place])
            elif d.kind in 'xy':
                pivot = z[:, int(structure.pivots[d.place][1:])]
                changes[d.name] = pivot.real if d.kind == 'x' else pivot.imag
        modes = [np.sign((np.conj(bars[a]) * bars[b]).imag) for a, b in structure.groups]
        return Variants(self.linkage, changes, assembly=np.array(modes))

    def _evaluate(self, x: FloatArray, out: dict[str, Any], *_: Any, **__: Any) -> None:
        variants = self.variants(self.positions(x))
        turns = whole_turns(variants, TURN_POINTS)
        # The grader counts a bar from each of its ends.
        is_length = [d.kind == 'length' for d in self.linkage.structure.dimensions]
        material = 2.0 * np.asarray(variants.numbers)[is_length].sum(axis=0)
        distance = np.full(len(x), 10.0)
        turns_wholly = turns.missing == 0.0
        # The rms distance, which is no less than the grader's mean distance.
        error = self.target.fit(turns.h[:, turns_wholly].transpose(1, 2, 0)).error
        distance[turns_wholly] = 2.0 * np.pi * error / self.radius
        excess = np.maximum(0.0, distance - MAX_DISTANCE)
        excess += np.maximum(0.0, material - MAX_MATERIAL)
        transmission_angle = np.nan_to_num(turns.transmission_angle)
        excess += np.maximum(0.0, MIN_TRANSMISSION_ANGLE - transmission_angle)
        out['F'] = np.column_stack([distance, material])
        out['G'] = np.where(turns_wholly, excess, 100.0 + turns.missing)[:, None]

    def sample(self, random: np.random.Generator) -> FloatArray:
        """Return the best of random candidates."""
        x = random.uniform(-REACH, REACH, (SAMPLES, self.n_var))
        out: dict[str, Any] = {}
        self._evaluate(x, out)
        order = np.lexsort([out['F'][:, 0], out['G'][:, 0]])
        return np.asarray(x[order[:POPULATION]])

    def evolve(self, generations: int, random: np.random.Generator) -> None:
        """Evolve, and keep the candidates that none dominates."""
        x = self.sample(random) if self.population is None else self.population
        algorithm = NSGA2(pop_size=len(x), sampling=x)
        seed = int(random.integers(2**31))
        population = minimize(self, algorithm, ('n_gen', generations), seed=seed).pop
        self.population = np.asarray(population.get('X'), dtype=np.float64)
        is_feasible = population.get('G')[:, 0] <= 0.0
        losses = population.get('F')[is_feasible]
        self.best = [*zip(self.population[is_feasible], losses, strict=True)]

    @property
    def score(self) -> float:
        """Return the area that the search dominates, by the rms distance."""
        return area(np.array([losses for _, losses in self.best]))


def area(losses: FloatArray) -> float:
    """Return the score of distances and materials, shape (n, 2)."""
    if not len(losses):
        return 0.0
    inside = losses[(losses < (MAX_DISTANCE, MAX_MATERIAL)).all(axis=1)]
    reference = np.array([MAX_DISTANCE, MAX_MATERIAL])
    return float(HV(ref_point=reference)(inside)) if len(inside) else 0.0


def grade_path(path: ComplexArray, curve: ComplexArray) -> float:
    """Return the grader's distance of a closed path from a curve, which it does not close."""
    w = _resample(np.append(path, path[0]))
    z = _resample(curve)
    radius = np.sqrt((np.abs(z) ** 2).mean())
    distances = []
    for polygon in (w, w[::-1]):
        shifted = np.array([np.roll(polygon, n) for n in range(CURVE_POINTS)]) / radius
        overlap = (np.conj(shifted) * z / radius).sum(axis=1)
        rotated = (overlap / np.abs(overlap))[:, None] * shifted
        distances.append(np.abs(rotated - z / radius).mean(axis=1).min())
    return 2.0 * np.pi * float(min(distances))


def _resample(z: ComplexArray) -> ComplexArray:
    """Return a polygon at equal steps of its length, about its centre."""
    arc_lengths = np.append(0.0, np.cumsum(np.abs(np.diff(z))))
    new_lengths = arc_lengths[-1] * np.linspace(0.0, 1.0 - 1e-6, CURVE_POINTS)
    resampled = np.interp(new_lengths, arc_lengths, z)
    return np.asarray(resampled - resampled.mean())


def search_curve(curve: ComplexArray, seconds: float, seed: int) -> list[ChainSearch]:
    """Return the searches of all chains for a curve, the best one first."""
    random = np.random.default_rng(seed)
    end_time = time.process_time() + seconds
    searches = [ChainSearch(chain, curve) for chain in list_chains(DYADS, PIVOTS)]
    candidates = searches
    generations = GENERATIONS
    for round_number in range(ROUNDS):
        for search in candidates:
            search.evolve(generations, random)
        candidates = sorted(candidates, key=lambda search: -search.score)
        candidates = candidates[: max(FINALISTS, int(KEPT * len(candidates)))]
        if round_number == 0 and SMOKE:
            return candidates
        generations *= 2
        if time.process_time() > end_time:
            break
    while time.process_time() < end_time:
        for search in candidates[:FINALISTS]:
            search.evolve(generations, random)
    return sorted(searches, key=lambda search: -search.score)


def write_entries(searches: Sequence[ChainSearch], curve: ComplexArray) -> list[dict[str, Any]]:
    """Return the linkages that no other dominates, as the grader reads them, with their losses."""
    candidates: list[tuple[list[float], ChainSearch, FloatArray]] = []
    for search in searches:
        candidates += [(losses.tolist(), search, x) for x, losses in search.best]
    candidates.sort(key=lambda candidate: candidate[0])
    min_material = np.inf
    entries: list[dict[str, Any]] = []
    for (_, material), search, x in candidates:
        if material >= min_material:
            continue
        min_material = material
        z = search.positions(x[None])
        h = whole_turns(search.variants(z), TURN_POINTS).h[:, 0]
        fixed = [0, *range(2, 2 + search.chain.pivots)]
        entries.append(
            {
                'x0': np.column_stack([z[0].real, z[0].imag]),
                'edges': np.array(search.chain.edges),
                'fixed_joints': np.array(fixed),
                'motor': np.array([0, 1]),
                'target_joint': search.chain.joints - 1,
                'losses': (grade_path(h[0] + 1j * h[1], curve), material),
            }
        )
    chosen = np.linspace(0, len(entries) - 1, min(len(entries), MAX_LINKAGES)).round().astype(int)
    return [entries[k] for k in chosen.tolist()]


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
    seconds = 60.0 * minutes / len(curves)
    scores: list[float] = []
    submission: dict[str, Any] = {}
    for k, points in enumerate(curves):
        curve = points.astype(np.float64) @ np.array([1.0, 1j])
        start_time = time.perf_counter()
        start_cpu = time.process_time()
        searches = search_curve(curve, seconds, k)
        linkages = write_entries(searches, curve)
        losses = [linkage.pop('losses') for linkage in linkages]
        scores.append(area(np.array(losses).reshape(-1, 2)))
        submission[f'Problem {k + 1}'] = linkages
        print(
            f'curve {k + 1}: {scores[-1]:.3f} of {CEILING}, {len(linkages)} linkages of '
            f'{len(searches)} structures, the best {searches[0].chain.dyads}; CPU '
            f'{time.process_time() - start_cpu:.0f} s, {time.perf_counter() - start_time:.0f} s',
            flush=True,
        )
    if len(names) > 1:
        np.save(names[1], np.array(submission, dtype=object))
    mean = float(np.mean(scores))
    print(f'mean {mean:.3f}, aim {AIM}; best public submission found {BEST_PUBLIC}')
    return exit_code(mean >= AIM)


if __name__ == '__main__':
    sys.exit(main())
