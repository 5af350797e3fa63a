"""From a log to a recording: decode what concerns the leg, count the rest."""

from collections.abc import Mapping

from klann_ros.kinematics.leg_types import Leg
from klann_ros.log.reader import Log

from .decoding import LegDecoder, LegRows, nanoseconds
from .recording import Recording
from .solvers import leg_solver, LegSolver, parent, solver_records
from .topics import recorded_losses, TopicTally


def load(log: Log, given: Leg | None = None) -> Recording:
    """
    Decode a log: of several legs the first by its namespace that has poses.

    Parameters
    ----------
    log : Log
        An open log.
    given : KlannLeg or LinkageLeg, optional
        What to hold the run against, instead of the leg in it.

    """
    records = solver_records(log.metadata)
    legs = {
        namespace: LegRows(leg_solver(records, namespace), given)
        for namespace in sorted({parent(topic.name) for topic in log.topics})
    }
    decoder, tally = LegDecoder(log.topics), TopicTally()
    for message in log.messages():
        tally.add(message)
        leg = legs.get(parent(message.topic.name))
        if leg is not None:
            decoder.add(message, leg)
    namespace = _reviewed(legs)
    leg = legs[namespace] if namespace in legs else LegRows(LegSolver(), given)
    since = 0 if given else leg.solver.leg_time
    start = nanoseconds(log.start_time)
    return Recording(
        path=', '.join(str(path) for path in log.paths),
        start=start,
        end=nanoseconds(log.end_time),
        topics=tally.figures(recorded_losses(log.metadata)),
        # Reading finds what an index hides, so this comes last.
        problem=log.problem,
        undecoded=decoder.undecoded(),
        remarks=(
            *_others(legs, namespace),
            *_several(leg.solver),
            *_change(leg, since, start),
        ),
        leg=leg.leg,
        leg_time=since,
        cranks=leg.cranks.series(),
        poses=leg.poses.series(),
        feet=leg.feet.series(),
    )


def _reviewed(legs: Mapping[str, LegRows]) -> str:
    """Return the first namespace that has poses, or else anything of a leg."""
    with_poses = (name for name, leg in legs.items() if leg.poses)
    return next(with_poses, next((name for name, leg in legs.items() if len(leg)), ''))


def _others(legs: Mapping[str, LegRows], namespace: str) -> list[str]:
    others = [name or '/' for name, leg in legs.items() if name != namespace and len(leg)]
    if not others:
        return []
    return [f'only the leg in {namespace or "/"} was reviewed, not what is in {", ".join(others)}']


def _several(solver: LegSolver) -> list[str]:
    if not solver.legs:
        return []
    names = ', '.join(solver.legs)
    return [f'the run is of the legs {names}: several legs are not judged yet']


def _change(leg: LegRows, since: int, start: int) -> list[str]:
    if not any(time < since for time in leg.poses.times):
        return []
    moment = (since - start) / 1e9
    return [f'the leg changed during the run; the poses before {moment:.2f} s were not judged']
