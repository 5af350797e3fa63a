"""The search of a leg: islands that evolve in any number of processes, then the proof."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
import hashlib
from itertools import chain
from time import monotonic
from typing import Any, NamedTuple, TypeAlias

from klann_ros.engines import EngineError, parallel_map, TaskError
from klann_ros.kinematics import GeometryError
from klann_ros.kinematics.arrays import FloatArray, IndexArray
from klann_ros.sanitize.text import counted
import numpy as np

from .distinct import is_same_leg
from .evolve import (
    evolve,
    hypervolume,
    Island,
    IslandScores,
    joined,
    pareto_front,
    POPULATION,
    scores,
    spread,
    variant_scores,
    WORST_LOSS,
)
from .figures import FIGURES
from .proof import FittedCandidate, FoundLeg, ProofError, prove
from .refine import leg_figures, refined
from .requirements import Aim, Limit, LIMIT_MARGIN, Requirements
from .rounding import rounded
from .titles import leg_titles

# Islands of a search, whatever the number of processes; and their rounds, after which they
# exchange their best.
ISLANDS = 4
ROUNDS = 5
MAX_ROUND = 20_000
MIGRANTS = 6
# Candidates of an island, however few evaluations a search has.
MIN_POPULATION = 20
DEFAULT_EVALUATIONS = 30_000
# Legs that are proven for each leg wanted, as some fail.
PROVEN_PER_LEG = 3
# With one aim: the number of the best candidates, and of those far apart that are refined.
BEST_CANDIDATES, REFINED_CANDIDATES = 120, 16

# With one aim: candidates between the best one and others far apart, and equal steps to each.
MAX_COMPROMISES, COMPROMISE_STEPS = 800, 7
# With one aim: the greatest loss beyond that of the best leg, relative to that of the best
# candidate after the first round, or to a tenth of the value that a figure is to be near.
MAX_EXTRA_LOSS = 0.1

# The population of an island that is given up.
DROPPED = np.empty((0, 0))
# Calls a function of each task in processes; returns the answers, in part CandidateRefusals.
_Run: TypeAlias = Callable[[Callable[[Any], Any], Sequence[Any]], list[Any]]


class Survivor(NamedTuple):
    """A candidate that holds the limits: the number of its space, x of shape (d,), its scores."""

    space: int
    x: FloatArray
    losses: FloatArray
    figures: dict[str, float]


class CandidateRefusal(NamedTuple):
    """Why there is no answer; the limit that does not hold, and the leg's figure (SI)."""

    reason: str
    limit: Limit | None = None
    figure: float = np.nan


class StateError(ValueError):
    """A state of another search, or a damaged one; the text says which."""


class State(NamedTuple):
    """
    A search between two rounds: all that a later one depends on.

    `populations` are those of the islands, and `hypervolumes` those after each round, in the
    `frame` of the first front: the minimum of each loss, and its range.
    """

    key: str
    rounds: int
    evaluations: int
    populations: tuple[FloatArray | None, ...]
    hypervolumes: tuple[float, ...] = ()
    frame: tuple[tuple[float, float], ...] = ()

    def content(self) -> dict[str, Any]:
        """Return it for JSON, whose numbers are exact."""
        populations = [None if x is None else x.tolist() for x in self.populations]
        return self._replace(populations=tuple(populations))._asdict()

    @classmethod
    def of(cls, content: Mapping[str, Any]) -> 'State':
        """Return a state from JSON, or a StateError."""
        try:
            populations = []
            for x in content['populations']:
                populations.append(None if x is None else np.array(x, dtype=np.float64, ndmin=1))
            frame = [(float(low), float(size)) for low, size in content['frame']]
            return cls(
                key=str(content['key']),
                rounds=int(content['rounds']),
                evaluations=int(content['evaluations']),
                populations=tuple(populations),
                hypervolumes=tuple(map(float, content['hypervolumes'])),
                frame=tuple(frame),
            )
        except (KeyError, OverflowError, TypeError, ValueError) as error:
            raise StateError('it is no state of a search') from error

    def check(self, requirements: Requirements, key: str) -> None:
        """Raise a StateError if no search of requirements and a key can be in this state."""
        island_count = max(ISLANDS, len(requirements.spaces))
        if self.key != key or len(self.populations) != island_count:
            raise StateError('the search to resume has other requirements or another seed')
        for n, x in enumerate(self.populations):
            if x is None or not len(x):
                continue
            shape = len(x), len(requirements.space(n).names)
            if x.shape != shape or len(x) > POPULATION or not ((x >= 0.0) & (x <= 1.0)).all():
                raise StateError(f'population {n} is damaged')
        aim_count = len(requirements.cheap_aims)
        numbers = np.array([*chain.from_iterable(self.frame), *self.hypervolumes])
        is_frame = len(self.frame) in {0, aim_count} and all(size > 0.0 for _, size in self.frame)
        if not (is_frame and np.isfinite(numbers).all()):
            raise StateError('its frame or a hypervolume is damaged')
        has_islands = any(x is None or len(x) for x in self.populations)
        if min(self.rounds, self.evaluations) < 0 or not has_islands:
            raise StateError('a count or a population is damaged')


@dataclass(frozen=True, eq=False)
class Progress:
    """The progress of a search after a round; `best` are figures in SI units."""

    evaluations: int
    seconds: float
    best: dict[str, float]


@dataclass(frozen=True, eq=False)
class SearchResult:
    """
    The result of a search.

    `legs` are the Pareto set, or a part of it that is spread out, by the first aim; `reasons` why
    there is none, by the figure that fails; `refused` the number of candidates that did not pass
    the proof, by the reason. Beside the evaluations of `state`, candidates were `refined` on a
    path, and `proven`. A KeyboardInterrupt may have ended the search.
    """

    requirements: Requirements
    legs: tuple[FoundLeg, ...]
    reasons: tuple[str, ...]
    state: State
    seed: int
    refused: Mapping[str, int]
    refined: int = 0
    proven: int = 0
    is_interrupted: bool = False

    @cached_property
    def titles(self) -> list[str]:
        """Return the title of each leg, '' for none."""
        return leg_titles(self.requirements, self.legs)


def search(
    requirements: Requirements,
    *,
    seed: int = 0,
    evaluations: int = DEFAULT_EVALUATIONS,
    time_limit: float | None = None,
    jobs: int | None = 1,
    engine: str = 'local',
    state: State | None = None,
    on_round: Callable[[State, Progress], object] | None = None,
) -> SearchResult:
    """
    Search for the legs that fulfil the requirements, and prove each.

    Parameters
    ----------
    requirements : Requirements
        The requirements.
    seed : int
        The same seed and evaluations give the same legs, for any number of jobs.
    evaluations : int
        Candidates that are judged, at most; 20 in each population at least.
    time_limit : float, optional
        The search ends after the round in which it passes [s].
    jobs : int, optional
        Number of processes; None is that of the CPUs.
    engine : str
        'local', or 'ray' for a cluster.
    state : State, optional
        Where an earlier search of these requirements and this seed ended.
    on_round : callable, optional
        Called after each round; a KeyboardInterrupt ends the search with what it has.

    Raises
    ------
    StateError
        The state is that of another search, or damaged.
    EngineError
        The engine is unavailable, or no worker answers.

    """
    # The hash of all that a search depends on.
    key = hashlib.sha256(f'{seed}\n{requirements.text}'.encode()).hexdigest()
    island_count = max(ISLANDS, len(requirements.spaces))
    state = state or State(key, 0, 0, (None,) * island_count)
    state.check(requirements, key)
    start_time = monotonic()
    is_interrupted = False
    run = partial(_in_order, jobs=jobs, engine=engine)
    # The populations of a resumed search are judged again.
    islands = []
    for n, x in enumerate(state.populations):
        if x is not None and len(x):
            islands.append(IslandScores(n, x, scores(requirements, requirements.space(n), x)))
    has_one_aim = requirements.target is None and len(requirements.cheap_aims) == 1
    max_compromises = MAX_COMPROMISES if has_one_aim else 0
    in_rounds = evaluations - min(max_compromises, evaluations // 10)
    try:
        while share := _share(state, evaluations, in_rounds):
            last_evaluations = state.evaluations
            state, islands = _next_round(
                requirements, state, islands, seed=seed, share=share, run=run
            )
            if on_round is not None:
                seconds = monotonic() - start_time
                on_round(state, _progress(requirements.cheap_aims, state, islands, seconds))
            is_late = time_limit is not None and monotonic() - start_time > time_limit
            # A population of equal candidates has no new ones.
            if is_late or state.evaluations == last_evaluations:
                break
    except KeyboardInterrupt:
        if not any(x is not None for x in state.populations):
            raise
        is_interrupted = True
    count = min(max_compromises, evaluations - state.evaluations)
    search_result = _proven_legs(
        requirements, state, islands, seed=seed, run=run, compromise_count=count
    )
    return replace(search_result, is_interrupted=is_interrupted)


def _share(state: State, evaluations: int, in_rounds: int) -> int:
    """Return how many candidates each island judges in the next round; 0 if it is the last."""
    sizes = [0 if x is None else len(x) for x in state.populations if x is None or len(x)]
    share = max(POPULATION, min(MAX_ROUND, evaluations // (len(sizes) * ROUNDS)))
    remaining = (in_rounds - state.evaluations) // len(sizes)
    if not max(sizes):
        return min(share, max(MIN_POPULATION, remaining))
    return 0 if remaining < max(sizes) else min(share, remaining)


def _next_round(
    requirements: Requirements,
    state: State,
    islands: Sequence[IslandScores],
    *,
    seed: int,
    share: int,
    run: _Run,
) -> tuple[State, list[IslandScores]]:
    """Return the state after a round, and the scores of its populations."""
    evolved = {island.island: island for island in islands}
    numbers = [n for n, x in enumerate(state.populations) if x is None or len(x)]
    tasks = []
    for n in numbers:
        # A worker needs the space of its island alone.
        own_requirements = replace(requirements, spaces=(requirements.space(n),))
        island_seed = (seed, state.rounds, n)
        tasks.append(Island(n, own_requirements, evolved.get(n), island_seed, share))
    answers = run(evolve, tasks)
    refusals = [answer for answer in answers if isinstance(answer, CandidateRefusal)]
    if len(refusals) == len(answers):
        raise EngineError(f'the search failed: {refusals[0].reason}')
    evaluations = state.evaluations
    for answer in answers:
        # The population of an island whose worker died twice stays as it was.
        if isinstance(answer, IslandScores):
            evolved[answer.island] = answer
            evaluations += answer.judged
    islands = _migrated(requirements, evolved)
    state = state._replace(rounds=state.rounds + 1, evaluations=evaluations)
    state = _with_hypervolume(state, islands)
    populations = [*state.populations]
    if len(numbers) > ISLANDS:
        # Each is that of a space of its own.
        islands = _better_half(state, islands)
        populations = [DROPPED] * len(populations)
    for island in islands:
        populations[island.island] = island.x
    return state._replace(populations=tuple(populations)), islands


def _migrated(
    requirements: Requirements, islands: Mapping[int, IslandScores]
) -> list[IslandScores]:
    """Return the islands, the worst of each replaced by the best of the one before it."""
    space_count = len(requirements.spaces)
    ranked = {n: islands[n].of(islands[n].scores.order) for n in sorted(islands)}
    migrated = []
    for n, island in ranked.items():
        # The islands of one space are a ring.
        ring = range(n % space_count, max(ISLANDS, space_count), space_count)
        neighbour = ranked.get(n - space_count if n >= space_count else ring[-1], island)
        if neighbour is island:
            migrated.append(islands[n])
            continue
        best = neighbour.of(np.arange(min(MIGRANTS, len(island.x))))
        residents = island.of(np.arange(len(island.x) - len(best.x)))
        x = np.concatenate([residents.x, best.x])
        migrated.append(island._replace(x=x, scores=joined([residents.scores, best.scores])))
    return migrated


def _with_hypervolume(state: State, islands: Sequence[IslandScores]) -> State:
    """Return the state with the volume that its front dominates."""
    losses = np.concatenate([island.scores.losses[island.holds] for island in islands])
    losses = losses[(losses < WORST_LOSS).all(axis=1)]
    if len(losses) and not state.frame:
        # Relative to the first front, so that later ones compare with it.
        front = losses[pareto_front(losses)]
        low = front.min(axis=0)
        size = np.ptp(front, axis=0)
        size = np.where(size > 0.0, size, np.maximum(np.abs(low), 1e-12))
        state = state._replace(frame=tuple(zip(low.tolist(), size.tolist(), strict=True)))
    return state._replace(hypervolumes=(*state.hypervolumes, _volume(state, losses)))


def _volume(state: State, losses: FloatArray) -> float:
    """Return the volume that losses dominate, in the frame of the first front."""
    if not len(losses):
        return 0.0
    low, size = np.array(state.frame).T
    return hypervolume((losses - low) / size, np.full(len(low), 1.1))


def _better_half(state: State, islands: Sequence[IslandScores]) -> list[IslandScores]:
    """Return the islands whose populations dominate most: half of them, or `ISLANDS`."""

    def rank(island: IslandScores) -> tuple[float, ...]:
        losses = island.scores.losses
        first = island.scores.order[0]
        volume = _volume(state, losses[island.holds])
        return -volume, float(island.scores.total[first]), float(losses[first].sum())

    count = max(ISLANDS, (len(islands) + 1) // 2)
    best = sorted(islands, key=rank)[:count]
    return sorted(best, key=lambda island: island.island)


def _progress(
    aims: Sequence[Aim], state: State, islands: Sequence[IslandScores], seconds: float
) -> Progress:
    best = {}
    for aim in aims:
        figures = [island.scores.figures[aim.figure][island.holds] for island in islands]
        finite = np.concatenate(figures)
        finite = finite[np.isfinite(finite)]
        if len(finite):
            best[aim.figure] = float(finite[aim.loss(finite).argmin()])
    return Progress(state.evaluations, seconds, best)


def _proven_legs(
    requirements: Requirements,
    state: State,
    islands: Sequence[IslandScores],
    *,
    seed: int,
    run: _Run,
    compromise_count: int,
) -> SearchResult:
    """Refine and prove the best candidates of a search."""
    survivors = _survivors(requirements, islands)
    if survivors and compromise_count >= COMPROMISE_STEPS:
        compromises = _compromises(requirements, survivors, compromise_count)
        state = state._replace(evaluations=state.evaluations + len(compromises.x))
        survivors = _survivors(requirements, [*islands, compromises])
    if survivors:
        chosen = [survivors[k] for k in _chosen(requirements, survivors, state).tolist()]
    else:
        # Refinement may bring the nearest ones within their limits.
        chosen = _nearest(requirements, islands)
    answers = run(partial(_fitted, requirements), chosen)
    fitted = [answer for answer in answers if isinstance(answer, FittedCandidate)]
    limits = requirements.cheap_limits
    candidates = [candidate for candidate in fitted if _may_hold(limits, candidate.expected)]
    if requirements.target is not None:
        candidates.sort(key=lambda candidate: candidate.expected['path_error'])
    legs: list[FoundLeg] = []
    refusals: list[CandidateRefusal] = []
    while candidates and len(legs) < requirements.count:
        batch, candidates = _next_batch(requirements, candidates, legs)
        for answer in run(partial(_proven, requirements), batch):
            if isinstance(answer, CandidateRefusal):
                refusals.append(answer)
            else:
                legs.append(answer)
    proven_count = len(legs) + len(refusals)
    legs = _best(requirements.aims, legs, state)
    counts = dict(Counter(refusal.reason for refusal in refusals))
    reasons = []
    if refusals and not legs:
        reasons = _refusal_reasons(requirements, refusals, counts)
    elif not legs:
        reasons = failing_figures(requirements, islands, fitted)
    return SearchResult(
        requirements,
        tuple(legs),
        tuple(reasons),
        state,
        seed,
        counts,
        refined=0 if survivors and requirements.target is None else len(chosen),
        proven=proven_count,
    )


def _next_batch(
    requirements: Requirements, candidates: Sequence[FittedCandidate], legs: Sequence[FoundLeg]
) -> tuple[list[FittedCandidate], list[FittedCandidate]]:
    """Return different candidates to prove, unlike the proven legs, and candidates for later."""
    target = requirements.target
    # Alike as far as requirements leave the plane free.
    is_copy = partial(is_same_leg, can_turn=target is not None and target.can_turn)
    batch: list[FittedCandidate] = []
    later: list[FittedCandidate] = []
    for candidate in candidates:
        if is_copy(candidate.linkage, [leg.linkage for leg in legs]):
            continue
        # A copy of a leg in the batch is for later, as that leg may not pass the proof.
        is_full = len(batch) == requirements.count - len(legs)
        is_later = is_full or is_copy(candidate.linkage, [chosen.linkage for chosen in batch])
        (later if is_later else batch).append(candidate)
    return batch, later


def _survivors(requirements: Requirements, islands: Sequence[IslandScores]) -> list[Survivor]:
    """Return the candidates that hold the limits of the evolution."""
    # Candidates that migrated are in two islands.
    survivors: dict[tuple[int, bytes], Survivor] = {}
    for island in islands:
        for i in np.flatnonzero(island.holds).tolist():
            survivor = _survivor(requirements, island, i)
            survivors.setdefault((survivor.space, survivor.x.tobytes()), survivor)
    return [*survivors.values()]


def _survivor(requirements: Requirements, island: IslandScores, i: int) -> Survivor:
    space = island.island % len(requirements.spaces)
    figures = {name: float(column[i]) for name, column in island.scores.figures.items()}
    return Survivor(space, island.x[i], island.scores.losses[i], figures)


def _nearest(requirements: Requirements, islands: Sequence[IslandScores]) -> list[Survivor]:
    """Return the candidate of each island that turns and violates the limits least."""
    nearest = []
    for island in islands:
        best = int(island.scores.order[0])
        if island.turns[best]:
            nearest.append(_survivor(requirements, island, best))
    return nearest


def _may_hold(limits: Sequence[Limit], figures: Mapping[str, float]) -> bool:
    """Return whether figures hold limits within twice the margin of the search."""
    for limit in limits:
        # Those of poses are rough in bulk.
        is_rough = FIGURES[limit.figure].needs == 'poses'
        if not (is_rough or limit.relative_shortfall(figures[limit.figure]) <= 2.0 * LIMIT_MARGIN):
            return False
    return True


def _compromises(
    requirements: Requirements, survivors: Sequence[Survivor], count: int
) -> IslandScores:
    """Return candidates between the best one, by one aim, and others of its space."""
    best = min(survivors, key=lambda survivor: survivor.losses[0])
    x = np.array([survivor.x for survivor in survivors if survivor.space == best.space])
    ends = x[spread(np.concatenate([best.x[None], x]), count // COMPROMISE_STEPS + 1)[1:] - 1]
    steps = np.linspace(0.0, 1.0, COMPROMISE_STEPS + 2)[1:-1, None, None]
    between = np.reshape(best.x + steps * (ends - best.x), (-1, len(best.x)))
    space = requirements.space(best.space)
    return IslandScores(best.space, between, scores(requirements, space, between))


def _refusal_reasons(
    requirements: Requirements, refusals: Sequence[CandidateRefusal], counts: Mapping[str, int]
) -> list[str]:
    """Return why no leg passed the proof: the nearest figure of each limit, then all reasons."""
    nearest: dict[Limit, float] = {}
    for refusal in refusals:
        if refusal.limit is not None:
            figures = [refusal.figure, nearest.get(refusal.limit, refusal.figure)]
            # A figure without a value (NaN) is the farthest.
            misses = np.nan_to_num(refusal.limit.shortfall(np.array(figures)), nan=np.inf)
            nearest[refusal.limit] = figures[int(misses.argmin())]
    reasons = []
    for limit, figure in nearest.items():
        reasons.append(_best_text(requirements, limit, figure))
    for reason, count in counts.items():
        reasons.append(f'{reason}: {counted(count, "leg")}')
    return reasons


def _in_order(function: Any, tasks: Sequence[Any], *, jobs: int | None, engine: str) -> list[Any]:
    """Return the answers in the order of the tasks; a CandidateRefusal of a task without one."""
    if jobs == 1 and engine == 'local':
        return list(map(function, tasks))
    answers = dict(parallel_map(function, tasks, engine=engine, jobs=jobs))
    for n, answer in answers.items():
        if isinstance(answer, TaskError):
            answers[n] = CandidateRefusal(answer.reason)
    return [answers[n] for n in range(len(tasks))]


def _chosen(requirements: Requirements, survivors: Sequence[Survivor], state: State) -> IndexArray:
    """Return the candidates to prove: far apart on the front, or of one aim among the best."""
    losses = np.array([survivor.losses for survivor in survivors])
    if losses.shape[1] > 1:
        front = pareto_front(losses)
        front = front[np.argsort(losses[front, 0], kind='stable')]
        return front[spread(losses[front], PROVEN_PER_LEG * requirements.count)]
    best = np.argsort(losses[:, 0], kind='stable')[:BEST_CANDIDATES].tolist()
    count = max(requirements.count, REFINED_CANDIDATES)
    if requirements.target is None:
        # Without refinement a worse candidate remains worse.
        max_loss = _max_loss(requirements.aims[0], state, losses[best[0], 0])
        best = [k for k in best if losses[k, 0] <= max_loss]
        count = PROVEN_PER_LEG * requirements.count
    # Only candidates of one linkage can be compared.
    comparable = []
    x = []
    for k in best:
        if survivors[k].space == survivors[best[0]].space:
            comparable.append(k)
            x.append(survivors[k].x)
    distant = np.array(comparable)[spread(np.array(x), count)]
    return np.asarray(distant[np.argsort(losses[distant, 0], kind='stable')])


def _fitted(requirements: Requirements, survivor: Survivor) -> FittedCandidate | CandidateRefusal:
    """Return a candidate, refined on a path or poses, and rounded; or why it is no linkage."""
    space = requirements.spaces[survivor.space]
    targets = requirements.target, requirements.poses, requirements.rounding
    is_whole = targets == (None, None, None)
    try:
        if is_whole and _may_hold(requirements.cheap_limits, survivor.figures):
            return FittedCandidate(space, space.variants(survivor.x[None])[0], survivor.figures)
        linkage = refined(requirements, space, survivor.x)
        if requirements.rounding is not None:
            judge = partial(variant_scores, requirements.without_motion())
            linkage = rounded(requirements.rounding, space, linkage, judge)
        figures = leg_figures(requirements, linkage)
    except GeometryError as error:
        return CandidateRefusal(str(error))
    return FittedCandidate(space, linkage, figures)


def _proven(requirements: Requirements, candidate: FittedCandidate) -> FoundLeg | CandidateRefusal:
    """Return a leg with its proof; or why it is none."""
    try:
        return prove(requirements, candidate)
    except ProofError as error:
        return CandidateRefusal(str(error), error.limit, error.value)


def _max_loss(aim: Aim, state: State, best_loss: float) -> float:
    """Return the greatest loss of a leg that is shown beside the best one, of one aim."""
    first_loss = state.frame[0][0] if state.frame else 0.0
    scale = max(abs(first_loss), abs(best_loss), 0.1 * abs(aim.value))
    return best_loss + MAX_EXTRA_LOSS * scale


def _best(aims: Sequence[Aim], legs: Sequence[FoundLeg], state: State) -> list[FoundLeg]:
    """Return the legs that no other dominates, or that are good by one aim, the best first."""
    if not legs:
        return []
    losses = np.empty((len(legs), len(aims)))
    for n, leg in enumerate(legs):
        losses[n] = [aim.loss(leg.reached.get(aim.figure, np.inf)) for aim in aims]
    front = np.arange(len(legs))
    if len(aims) > 1:
        losses = np.nan_to_num(losses, nan=WORST_LOSS, posinf=WORST_LOSS, neginf=WORST_LOSS)
        front = pareto_front(losses)
    elif not FIGURES[aims[0].figure].is_costly:
        front = np.flatnonzero(losses[:, 0] <= _max_loss(aims[0], state, losses[:, 0].min()))
    best_first = front[np.argsort(losses[front, 0], kind='stable')]
    return [legs[k] for k in best_first.tolist()]


def failing_figures(
    requirements: Requirements,
    islands: Sequence[IslandScores],
    fitted: Sequence[FittedCandidate] = (),
) -> list[str]:
    """Return why no candidate fulfils the requirements: the limits that bind, and their best."""
    if not any(island.turns.any() for island in islands):
        jam = min(float(island.scores.violations[:, 0].min()) for island in islands)
        missing = f'{100.0 * min(jam, 1.0):.1f} % of the turn'
        remedy = 'vary more, or other dimensions'
        return [f'no candidate turns fully (the best one misses {missing}): {remedy}']
    figures: dict[Limit, FloatArray] = {}
    lacks: dict[Limit, FloatArray] = {}
    for limit in requirements.cheap_limits:
        columns = [island.scores.figures[limit.figure][island.turns] for island in islands]
        columns.append(np.array([candidate.expected[limit.figure] for candidate in fitted]))
        figures[limit] = np.concatenate(columns)
        misses = limit.relative_shortfall(figures[limit])
        lacks[limit] = np.nan_to_num(np.maximum(0.0, misses), nan=np.inf)
    nearest = int(np.sum([*lacks.values()], axis=0).argmin())
    alone = []
    together = []
    for limit, lack in lacks.items():
        best = figures[limit][lack.argmin()]
        if lack.min() > 0.0:
            alone.append(_best_text(requirements, limit, best))
        elif lack[nearest] > 0.0:
            reached = _best_text(requirements, limit, figures[limit][nearest])
            best_text = requirements.figure_text(limit.figure, best)
            together.append(f'{reached} beside the other limits, {best_text} alone')
    return (
        alone or together or ['the limits hold only within rounding: relax one of them a little']
    )


def _best_text(requirements: Requirements, limit: Limit, figure: float) -> str:
    """Return a limit that does not hold, and the best figure that was reached."""
    text = partial(requirements.figure_text, limit.figure)
    bound = f'{limit.figure} {limit.sense.replace("_", " ")} {text(limit.value)}'
    return f'{bound}: {"no value" if np.isnan(figure) else f"best {text(figure)}"}'
