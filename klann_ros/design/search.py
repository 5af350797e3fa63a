"""The search of a leg: islands that evolve in any number of processes, then the proof."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
import hashlib
from time import monotonic
from typing import Any, NamedTuple, TypeAlias

from klann_ros.engines import EngineError, parallel_map, TaskError
from klann_ros.kinematics import GeometryError
from klann_ros.kinematics.arrays import FloatArray
from klann_ros.sanitize.text import counted
import numpy as np

from .evolve import (
    evolve,
    hypervolume,
    Island,
    pareto_front,
    POPULATION,
    Scores,
    scores,
    spread,
    WORST_LOSS,
)
from .proof import FittedCandidate, FoundLeg, ProofError, prove
from .refine import refined
from .requirements import Aim, Limit, Requirements

# Islands of a search, whatever the number of processes; and their rounds, after which they
# exchange their best.
ISLANDS, ROUNDS = 4, 5
MAX_ROUND, MIGRANTS = 20_000, 6
DEFAULT_EVALUATIONS = 30_000
# Legs that are proven for each leg wanted, as some fail.
PROVEN_PER_LEG = 3
# With one aim: the number of the best candidates, and of those far apart that are refined.
BEST_CANDIDATES, REFINED_CANDIDATES = 120, 16

# The population of an island that is given up.
DROPPED = np.empty((0, 0))
_Population: TypeAlias = FloatArray | None
# Space, candidates and scores of each island; space, x, losses and figures of a candidate.
_Scored: TypeAlias = Sequence[tuple[int, FloatArray, Scores]]
_Row: TypeAlias = tuple[int, FloatArray, FloatArray, dict[str, float]]
# Calls a function of each item in processes; returns the answers.
_Run: TypeAlias = Callable[[Callable[[Any], Any], Sequence[Any]], list[Any]]


class State(NamedTuple):
    """
    A search between two rounds: all that a later one depends on.

    `populations` are those of the islands, and `hypervolumes` those after each round, in the
    `frame` of the first front: the least of each loss, and its range.
    """

    key: str
    rounds: int
    evaluations: int
    populations: tuple[FloatArray | None, ...]
    hypervolumes: tuple[float, ...] = ()
    frame: tuple[tuple[float, float], ...] = ()

    def content(self) -> dict[str, Any]:
        """Return it for JSON, whose numbers are exact."""
        own = self._asdict()
        own['populations'] = [None if x is None else x.tolist() for x in self.populations]
        return own

    @classmethod
    def of(cls, content: Mapping[str, Any]) -> 'State':
        """Return that of JSON; errors are KeyError, TypeError and ValueError."""
        arrays = [
            None if x is None else np.array(x, dtype=np.float64) for x in content['populations']
        ]
        hypervolumes = tuple(map(float, content['hypervolumes']))
        numbers = int(content['rounds']), int(content['evaluations'])
        frame = tuple((float(low), float(reach)) for low, reach in content['frame'])
        return cls(str(content['key']), *numbers, tuple(arrays), hypervolumes, frame)


@dataclass(frozen=True, eq=False)
class Progress:
    """What a search has after a round: evaluations, seconds, hypervolume, best figures (SI)."""

    evaluations: int
    seconds: float
    hypervolume: float
    best: dict[str, float]


@dataclass(frozen=True, eq=False)
class Found:
    """
    The result of a search.

    `legs` are the Pareto set, or a part of it that is spread out, by the first aim; `reasons` why
    there is none, by the figure that fails; `refused` the number of candidates that did not pass
    the proof, by the reason. A KeyboardInterrupt may have ended the search.
    """

    requirements: Requirements
    legs: tuple[FoundLeg, ...]
    reasons: tuple[str, ...]
    state: State
    seed: int
    refused: Mapping[str, int]
    is_interrupted: bool = False


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
) -> Found:
    """
    Search for the legs that fulfil the requirements, and prove each.

    Parameters
    ----------
    requirements : Requirements
        The requirements.
    seed : int
        The same seed and evaluations give the same legs, for any number of jobs.
    evaluations : int
        Candidates that are judged.
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
    ValueError
        The state is that of another search.
    EngineError
        The engine is unavailable, or no worker answers.

    """
    # Of all that a search depends on.
    key = hashlib.sha256(f'{seed}\n{requirements.text}'.encode()).hexdigest()
    count = max(ISLANDS, len(requirements.spaces))
    now = state or State(key, 0, 0, (None,) * count)
    if now.key != key or len(now.populations) != count:
        raise ValueError('the search to resume has other requirements or another seed')
    start, is_interrupted = monotonic(), False
    run = partial(_in_order, jobs=jobs, engine=engine)
    try:
        while now.evaluations < evaluations:
            now, every = _next_round(requirements, now, seed, evaluations, run)
            if on_round is not None:
                seconds = monotonic() - start
                on_round(now, _progress(requirements.cheap_aims, now, every, seconds))
            if time_limit is not None and monotonic() - start > time_limit:
                break
    except KeyboardInterrupt:
        if not any(x is not None for x in now.populations):
            raise
        is_interrupted = True
    found = _found(requirements, now, seed, run)
    return replace(found, is_interrupted=is_interrupted)


def _next_round(
    requirements: Requirements, state: State, seed: int, evaluations: int, run: _Run
) -> tuple[State, _Scored]:
    """Return the state after a round, and the scores of its populations."""
    numbers = [n for n, x in enumerate(state.populations) if x is None or len(x)]
    share = max(POPULATION, min(MAX_ROUND, evaluations // (len(numbers) * ROUNDS)))
    islands = [
        # Of many spaces a worker needs its own alone.
        Island(
            replace(requirements, spaces=(requirements.space(n),)),
            state.populations[n],
            (seed, state.rounds, n),
            share,
        )
        for n in numbers
    ]
    answers = run(evolve, islands)
    failed = [answer for answer in answers if isinstance(answer, str)]
    if len(failed) == len(answers):
        raise EngineError(f'the search failed: {failed[0]}')
    populations = [*state.populations]
    for n, answer in zip(numbers, answers, strict=True):
        # Of an island whose worker died twice the population stays as it was.
        if not isinstance(answer, str):
            populations[n] = answer
    populations = _migrated(requirements, populations)
    rounds, spent = state.rounds + 1, state.evaluations + share * len(islands)
    state = state._replace(rounds=rounds, evaluations=spent, populations=tuple(populations))
    every = _all_scores(requirements, state)
    state = _with_hypervolume(state, every)
    if len(numbers) > ISLANDS and len(requirements.spaces) > ISLANDS:
        # The island of a space has its number.
        better = _better_half(state, every)
        pairs = enumerate(state.populations)
        state = state._replace(populations=tuple(x if n in better else DROPPED for n, x in pairs))
    return state, every


def _migrated(requirements: Requirements, populations: Sequence[_Population]) -> list[_Population]:
    """Return the populations, the worst of each replaced by the best of the one before it."""
    spaces = len(requirements.spaces)
    ranked = {
        n: x[scores(requirements, requirements.space(n), x).order]
        for n, x in enumerate(populations)
        if x is not None and len(x)
    }
    moved = [*populations]
    for n, x in ranked.items():
        same = [k for k in range(n % spaces, len(populations), spaces) if k != n]
        before = max([k for k in same if k < n], default=same[-1] if same else n)
        if before != n and before in ranked:
            moved[n] = np.concatenate([x[:-MIGRANTS], ranked[before][:MIGRANTS]])
    return moved


def _all_scores(requirements: Requirements, state: State) -> _Scored:
    """Return the scores of each island that has a population."""
    return [
        (n % len(requirements.spaces), x, scores(requirements, requirements.space(n), x))
        for n, x in enumerate(state.populations)
        if x is not None and len(x)
    ]


def _with_hypervolume(state: State, every: _Scored) -> State:
    """Return the state with the volume that its front dominates."""
    losses = np.concatenate([s.losses[s.total <= 0.0] for _, _, s in every])
    losses = losses[(losses < WORST_LOSS).all(axis=1)]
    if len(losses) and not state.frame:
        # Relative to the first front, so that later ones compare with it.
        front = losses[pareto_front(losses)]
        low, reach = front.min(axis=0), np.ptp(front, axis=0)
        reach = np.where(reach > 0.0, reach, np.maximum(np.abs(low), 1e-12))
        state = state._replace(frame=tuple(zip(low.tolist(), reach.tolist(), strict=True)))
    return state._replace(hypervolumes=(*state.hypervolumes, _volume(state, losses)))


def _volume(state: State, losses: FloatArray) -> float:
    """Return the volume that losses dominate, in the frame of the first front."""
    if not len(losses):
        return 0.0
    low, reach = np.array(state.frame).T
    return hypervolume((losses - low) / reach, np.full(len(low), 1.1))


def _better_half(state: State, every: _Scored) -> list[int]:
    """Return the islands whose populations dominate most: half of them, or `ISLANDS`."""

    def rank(item: tuple[int, FloatArray, Scores]) -> tuple[float, ...]:
        _, _, own = item
        first = own.order[0]
        volume = _volume(state, own.losses[own.total <= 0.0])
        return -volume, float(own.total[first]), float(own.losses[first].sum())

    count = max(ISLANDS, (len(every) + 1) // 2)
    return [n for n, _, _ in sorted(every, key=rank)[:count]]


def _progress(aims: Sequence[Aim], state: State, every: _Scored, seconds: float) -> Progress:
    best = {}
    for aim in aims:
        values = [s.figures[aim.figure][s.total <= 0.0] for _, _, s in every]
        known = np.concatenate(values)
        known = known[np.isfinite(known)]
        if len(known):
            best[aim.figure] = float(known[aim.loss(known).argmin()])
    return Progress(state.evaluations, seconds, state.hypervolumes[-1], best)


def _found(requirements: Requirements, state: State, seed: int, run: _Run) -> Found:
    every = _all_scores(requirements, state)
    rows = [
        (space, x[i], s.losses[i], {name: float(v[i]) for name, v in s.figures.items()})
        for space, x, s in every
        for i in np.flatnonzero(s.total <= 0.0).tolist()
    ]
    if not rows:
        reasons = failing_figures(requirements, every)
        return Found(requirements, (), tuple(reasons), state, seed, {})
    chosen = [rows[k] for k in _chosen(requirements, rows).tolist()]
    made = run(partial(_made, requirements), chosen)
    ready = [candidate for candidate in made if not isinstance(candidate, str)]
    if requirements.target is not None:
        ready.sort(key=lambda candidate: candidate.expected['path_error'])
    legs: list[FoundLeg] = []
    refused: dict[str, int] = {}
    nearest: dict[Limit, float] = {}
    for start in range(0, len(ready), requirements.count):
        batch = ready[slice(start, start + requirements.count)]
        for answer in run(partial(_proven, requirements), batch):
            if isinstance(answer, FoundLeg):
                legs.append(answer)
                continue
            text, limit, value = answer if isinstance(answer, tuple) else (answer, None, 0.0)
            refused[text] = refused.get(text, 0) + 1
            if limit is not None:
                values = [value, nearest.get(limit, value)]
                # A figure without a value (NaN) is the farthest.
                misses = np.nan_to_num(limit.shortfall(np.array(values)), nan=np.inf)
                nearest[limit] = values[int(misses.argmin())]
        if len(legs) >= requirements.count:
            break
    legs = _best(requirements.aims, legs[: requirements.count])
    reasons = [_shortfall(requirements, limit, value) for limit, value in nearest.items()]
    reasons += [f'{text}: {counted(n, "leg")}' for text, n in refused.items()]
    reasons = [] if legs else reasons
    return Found(requirements, tuple(legs), tuple(reasons), state, seed, refused)


def _in_order(function: Any, items: Sequence[Any], *, jobs: int | None, engine: str) -> list[Any]:
    """Return the answers in the order of the items; an item without one has its reason."""
    if jobs == 1 and engine == 'local':
        return list(map(function, items))
    answers = dict(parallel_map(function, items, engine=engine, jobs=jobs))
    found = [answers[n] for n in range(len(items))]
    return [answer.reason if isinstance(answer, TaskError) else answer for answer in found]


def _chosen(requirements: Requirements, rows: Sequence[Any]) -> Any:
    """Return the candidates to prove: far apart on the front, or of one aim among the best."""
    losses = np.array([row[2] for row in rows])
    if losses.shape[1] > 1:
        front = pareto_front(losses)
        front = front[np.argsort(losses[front, 0], kind='stable')]
        return front[spread(losses[front], PROVEN_PER_LEG * requirements.count)]
    best = np.argsort(losses[:, 0], kind='stable')[:BEST_CANDIDATES]
    # Only those of one linkage can be compared.
    same = best[[rows[k][0] == rows[best[0]][0] for k in best.tolist()]]
    x = np.array([rows[k][1] for k in same.tolist()])
    some = same[spread(x, max(requirements.count, REFINED_CANDIDATES))]
    return some[np.argsort(losses[some, 0], kind='stable')]


def _made(requirements: Requirements, row: _Row) -> FittedCandidate | str:
    """Return a candidate, refined on a path; or why it is no linkage."""
    number, x, _, expected = row
    space, target = requirements.spaces[number], requirements.target
    try:
        if target is None:
            return FittedCandidate(space, space.variants(x[None])[0], expected)
        linkage, distance = refined(target, space, x)
    except GeometryError as error:
        return str(error)
    return FittedCandidate(space, linkage, {**expected, 'path_error': distance})


def _proven(
    requirements: Requirements, candidate: FittedCandidate
) -> FoundLeg | tuple[str, Limit | None, float]:
    """Return a leg with its proof; or why it is none, the limit that fails and the figure."""
    try:
        return prove(requirements, candidate)
    except ProofError as refusal:
        return str(refusal), refusal.limit, refusal.value


def _best(aims: Sequence[Aim], legs: Sequence[FoundLeg]) -> list[FoundLeg]:
    """Return the legs that no other dominates by the figures of their sheets, by the first aim."""
    if not legs:
        return []
    rows = [[aim.loss(leg.reached.get(aim.figure, np.inf)) for aim in aims] for leg in legs]
    table = np.array(rows, dtype=np.float64)
    if len(aims) == 1:
        return [legs[k] for k in np.argsort(table[:, 0], kind='stable').tolist()]
    table = np.nan_to_num(table, nan=WORST_LOSS, posinf=WORST_LOSS, neginf=WORST_LOSS)
    front = pareto_front(table)
    return [legs[k] for k in front[np.argsort(table[front, 0], kind='stable')].tolist()]


def failing_figures(requirements: Requirements, every: _Scored) -> list[str]:
    """Return why no candidate fulfils the requirements: the figure that fails, and by how much."""
    turning = [s.violations[:, 0] <= 0.0 for _, _, s in every]
    if not any(t.any() for t in turning):
        least = min(float(s.violations[:, 0].min()) for _, _, s in every)
        missing = f'{100.0 * min(least, 1.0):.1f} % of the turn'
        remedy = 'vary more, or other dimensions'
        return [f'no candidate turns fully (the best one misses {missing}): {remedy}']
    nearest = min(
        (float(s.total[i]), n, i)
        for n, ((_, _, s), t) in enumerate(zip(every, turning, strict=True))
        for i in np.flatnonzero(t).tolist()
    )
    _, n, i = nearest
    found = every[n][2]
    reasons = []
    for limit in requirements.cheap_limits:
        values = [s.figures[limit.figure][t] for (_, _, s), t in zip(every, turning, strict=True)]
        known = np.concatenate(values)
        known = known[np.isfinite(known)]
        own = float(found.figures[limit.figure][i])
        if limit.shortfall(own) <= 0.0:
            continue
        reason = _shortfall(requirements, limit, own)
        if len(known):
            best = float(known[limit.shortfall(known).argmin()])
            reason += f'; alone it reaches {requirements.figure_text(limit.figure, best)}'
        reasons.append(reason)
    return reasons or ['the limits hold only within rounding: relax one of them a little']


def _shortfall(requirements: Requirements, limit: Limit, value: float) -> str:
    """Return by how much a figure misses a limit."""
    text = partial(requirements.figure_text, limit.figure)
    wanted = f'{limit.sense.replace("_", " ")} {text(limit.value)}'
    if np.isnan(value):
        return f'{limit.figure} has no value where {wanted} is wanted'
    miss = text(float(limit.shortfall(value)))
    return f'{limit.figure} is {text(value)} where {wanted} is wanted, {miss} short'
