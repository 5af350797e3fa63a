"""Candidates: judged in bulk, sampled, and evolved (NSGA-II, differential evolution)."""

from collections.abc import Sequence
from typing import Any, NamedTuple

from klann_ros.kinematics import linkage_poses, Variants
from klann_ros.kinematics.arrays import BoolArray, FloatArray, IndexArray
import numpy as np

from .figures import CANDIDATE_ANGLES, crank_angles, judge
from .poses import EXACT_IN_SEARCH
from .requirements import Requirements
from .space import Space

POPULATION = 120
# Candidates sampled for each of the first population, and judged at once: too few poses for a
# kernel that is compiled, which takes seconds a structure.
SAMPLES_PER_CANDIDATE = 25
MAX_JUDGED = 1024
# Of the loss of a candidate without figures.
WORST_LOSS = 1e9
# The violation of a limit that is missed by far, or by a candidate that does not turn.
WORST_VIOLATION = 1.0
SEARCH_VALUES = {'exact_error': EXACT_IN_SEARCH}


class Scores(NamedTuple):
    """
    Losses and violations of candidates, 0 or less if they hold, shapes (n, m) and (n, g).

    `figures` are those of the requirements by name, shape (n,).
    """

    losses: FloatArray
    violations: FloatArray
    figures: dict[str, FloatArray]

    @property
    def total(self) -> FloatArray:
        """Return the sum of the violations of each candidate; 0 if it holds all."""
        return np.asarray(np.maximum(0.0, self.violations).sum(axis=1))

    @property
    def order(self) -> IndexArray:
        """Return the candidates from the best: by their violations, then by their losses."""
        return np.asarray(np.lexsort([self.losses.sum(axis=1), self.total]), dtype=np.intp)

    def of(self, candidates: IndexArray) -> 'Scores':
        """Return those of some candidates."""
        figures = {name: column[candidates] for name, column in self.figures.items()}
        return Scores(self.losses[candidates], self.violations[candidates], figures)


def scores(requirements: Requirements, space: Space, x: FloatArray) -> Scores:
    """Return the scores of candidates, x of shape (n, d) in [0, 1]."""
    chunks = []
    for start in range(0, max(1, len(x)), MAX_JUDGED):
        variants = space.variants(x[slice(start, start + MAX_JUDGED)])
        chunks.append(variant_scores(requirements, variants))
    return joined(chunks)


def joined(chunks: Sequence[Scores]) -> Scores:
    """Return the scores of several groups of candidates in one."""
    figures = {}
    for name in chunks[0].figures:
        figures[name] = np.concatenate([chunk.figures[name] for chunk in chunks])
    losses = np.concatenate([chunk.losses for chunk in chunks])
    violations = np.concatenate([chunk.violations for chunk in chunks])
    return Scores(losses, violations, figures)


def variant_scores(requirements: Requirements, variants: Variants) -> Scores:
    """Return the scores of candidates, computed at once."""
    names = frozenset(requirements.figures)
    judgement = judge(variants, names, requirements.load)
    figures = judgement.figures
    if requirements.target is not None:
        figures['path_error'] = np.full(len(variants), np.nan)
        turning = np.flatnonzero(judgement.turns)
        figures['path_error'][turning] = requirements.target.fit(judgement.h[turning]).error
    if requirements.poses or requirements.areas:
        poses: Any = linkage_poses(variants, crank_angles(CANDIDATE_ANGLES), points=True)
        figures |= requirements.turn_figures(variants.base.structure, poses.points)
    losses = []
    for aim in requirements.cheap_aims:
        losses.append(np.where(judgement.turns, aim.loss(figures[aim.figure]), WORST_LOSS))
    # Without a cheap aim any candidate that holds the limits is as good.
    losses = losses or [np.where(judgement.turns, 0.0, WORST_LOSS)]
    violations = [judgement.jam]
    for limit in requirements.evolved_limits:
        # The refinement of exact poses begins near them.
        bound = limit._replace(value=SEARCH_VALUES.get(limit.figure, limit.value))
        miss = bound.relative_shortfall(figures[limit.figure])
        # Below the worst, so that whatever turns is better than all that does not.
        miss = np.where(miss > 0.0, miss / (1.0 + miss), miss)
        violations.append(np.where(judgement.turns, miss, WORST_VIOLATION))
    loss_table = np.nan_to_num(np.array(losses), nan=WORST_LOSS, posinf=WORST_LOSS).T
    return Scores(loss_table, np.nan_to_num(np.array(violations), nan=WORST_VIOLATION).T, figures)


class IslandScores(NamedTuple):
    """
    The number of an island, its candidates of shape (n, d), and their scores.

    `judged` is the number of candidates that were judged for them.
    """

    island: int
    x: FloatArray
    scores: Scores
    judged: int = 0

    @property
    def holds(self) -> BoolArray:
        """Return whether each candidate holds all limits."""
        return np.asarray(self.scores.total <= 0.0)

    @property
    def turns(self) -> BoolArray:
        """Return whether each candidate turns."""
        return np.asarray(self.scores.violations[:, 0] <= 0.0)

    def of(self, candidates: IndexArray) -> 'IslandScores':
        """Return some of its candidates."""
        return self._replace(x=self.x[candidates], scores=self.scores.of(candidates))


class Island(NamedTuple):
    """
    A population that evolves by itself for a while; without one it is sampled first.

    Its requirements have its space alone. At most `evaluations` candidates are judged.
    """

    number: int
    requirements: Requirements
    population: IslandScores | None
    seed: tuple[int, ...]
    evaluations: int


def evolve(island: Island) -> IslandScores:
    """Return the population of an island after its evaluations."""
    requirements = island.requirements
    (space,) = requirements.spaces
    random = np.random.default_rng(island.seed)
    population = island.population
    sampled_count = 0
    if population is None:
        sampled_count = min(POPULATION * SAMPLES_PER_CANDIDATE, island.evaluations)
        x = space.sample(random, sampled_count)
        sampled = scores(requirements, space, x)
        population = IslandScores(island.number, x, sampled).of(_chosen(sampled))
    generations = (island.evaluations - sampled_count) // len(population.x)
    if generations > 0:
        population = _evolve_generations(requirements, population, random, generations)
    return population._replace(judged=population.judged + sampled_count)


def _chosen(sampled: Scores) -> IndexArray:
    """Return a population: half of it the best, half far apart of the rest that is as good."""
    order = sampled.order
    best = order[: POPULATION // 2]
    distant = np.setdiff1d(order[sampled.total[order] <= 0.0], best)
    if len(distant):
        distant = distant[spread(sampled.losses[distant], POPULATION - len(best))]
    chosen = np.concatenate([best, distant])
    remaining = order[~np.isin(order, chosen)]
    return np.asarray(np.concatenate([chosen, remaining])[:POPULATION], dtype=np.intp)


def _evolve_generations(
    requirements: Requirements,
    population: IslandScores,
    random: np.random.Generator,
    generations: int,
) -> IslandScores:
    """Return a population after some generations, by one aim or by several."""
    # It takes a second to load, and only a search needs it.
    from pymoo.algorithms.moo.nsga2 import NSGA2  # noqa: PLC0415
    from pymoo.algorithms.soo.nonconvex.de import DE  # noqa: PLC0415
    from pymoo.core.population import Population  # noqa: PLC0415
    from pymoo.core.problem import Problem  # noqa: PLC0415
    from pymoo.optimize import minimize  # noqa: PLC0415

    (space,) = requirements.spaces
    size, dimension_count = population.x.shape
    aims = population.scores.losses.shape[1]
    limits = population.scores.violations.shape[1]

    def pymoo_columns(candidates: Scores) -> dict[str, FloatArray]:
        return {'F': candidates.losses, 'G': candidates.violations, **candidates.figures}

    class SearchProblem(Problem):  # type: ignore[misc]  # pymoo has no types
        """The requirements as pymoo has them."""

        def _evaluate(self, x: Any, out: Any, *_: Any, **__: Any) -> None:
            out.update(pymoo_columns(scores(requirements, space, x)))

    problem = SearchProblem(n_var=dimension_count, n_obj=aims, n_ieq_constr=limits, xl=0, xu=1)
    # Its candidates are judged already.
    start = Population.new(X=population.x, **pymoo_columns(population.scores))
    for individual in start:
        individual.evaluated.update('FGH')
    kind = DE if aims == 1 else NSGA2
    algorithm = kind(pop_size=size, sampling=start)
    seed = int(random.integers(2**31))
    # pymoo counts the start as a generation.
    optimum = minimize(problem, algorithm, ('n_gen', generations + 1), seed=seed)
    x, losses, violations = map(optimum.pop.get, 'XFG')
    figures = {name: optimum.pop.get(name) for name in population.scores.figures}
    evolved = Scores(losses, violations, figures)
    return IslandScores(population.island, x, evolved, optimum.algorithm.evaluator.n_eval)


def spread(points: FloatArray, count: int) -> IndexArray:
    """
    Return rows of points, shape (n, m), that are far from each other: the first row first.

    Farthest-point sampling of the points relative to their ranges; of equal rows the first alone.
    """
    size = np.ptp(points, axis=0)
    relative = (points - points.min(axis=0)) / np.where(size > 0.0, size, 1.0)
    chosen = [0]
    distance = np.linalg.norm(relative - relative[0], axis=1)
    while len(chosen) < count and distance.max() > 0.0:
        chosen.append(int(distance.argmax()))
        distance = np.minimum(distance, np.linalg.norm(relative - relative[chosen[-1]], axis=1))
    return np.array(chosen, dtype=np.intp)


def pareto_front(losses: FloatArray) -> IndexArray:
    """Return the rows that no other row dominates, shape (n, m); of equal rows the first."""
    front: list[int] = []
    for n in np.lexsort(losses.T[::-1]).tolist():
        is_better = losses[front] <= losses[n]
        if not is_better.all(axis=1).any():
            front.append(n)
    return np.array(sorted(front), dtype=np.intp)


def hypervolume(losses: FloatArray, reference: FloatArray) -> float:
    """Return the volume that rows of losses dominate up to a reference point."""
    from pymoo.indicators.hv import HV  # noqa: PLC0415 - see `_evolve_generations`

    inside = losses[(losses < reference).all(axis=1)]
    return float(HV(ref_point=reference)(inside)) if len(inside) else 0.0
