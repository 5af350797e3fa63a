"""What a run says about itself in metadata records: solvers, pauses, losses and their causes."""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
import json
from typing import Any

from klann_ros.sanitize.text import printable

SOLVER_RECORD = 'klann_ros.solver'
LOSS_RECORD = 'klann_ros.loss'
HARM_RECORD = 'klann_ros.harm'
PAUSE_RECORD = 'klann_ros.pause'
RECORDER_RECORD = 'klann_ros.recorder'
FINDING_RECORD = 'klann_ros.finding'
EVENT_RECORD = 'klann_ros.event'
# The solver's parameter that holds the text of its linkage's file; empty for a Klann leg.
LINKAGE_PARAMETER = 'linkage_description'
# The player's parameter that holds the records of a run's solvers, and how many of them at most.
REPLAYED_PARAMETER = 'recorded_solvers'
MOST_REPLAYED = 64
# What a garbled record ends in: numbers may be infinite, and lists in lists without end.
_GARBLED = (AttributeError, KeyError, OverflowError, RecursionError, TypeError, ValueError)


@dataclass(frozen=True)
class SolverParameters:
    """The parameters of a solver at a time; a run has one for each change that it heard of."""

    # The solver's full name.
    node: str
    # When it had them [ns since the epoch], on the clock of the log times.
    time: int
    # The parameters by name: numbers, texts, flags, and lists of them.
    parameters: dict[str, Any]


def solver_record(solver: SolverParameters) -> dict[str, str]:
    """Return the metadata record of a solver's parameters."""
    parameters = json.dumps(solver.parameters, sort_keys=True)
    return {'node': solver.node, 'time': str(solver.time), 'parameters': parameters}


def solver_parameters(record: Mapping[str, str]) -> SolverParameters:
    """Return a solver's parameters from a metadata record; a ValueError if it is none of them."""
    try:
        parameters = dict(json.loads(record['parameters']))
        return SolverParameters(record['node'], int(record['time']), parameters)
    except _GARBLED:
        raise ValueError(f'not a record of a solver: {printable(dict(record))}') from None


def replayed_text(records: Sequence[Mapping[str, str]]) -> str:
    """Return what a player tells of a run's solvers, the last ones, as JSON."""
    found = []
    for record in records[-MOST_REPLAYED:]:
        with suppress(ValueError):
            found.append(solver_record(solver_parameters(record)))
    return json.dumps(found)


def replayed_solvers(text: str) -> list[SolverParameters]:
    """Return what a player tells of a run's solvers, in the order of time: anybody's text."""
    try:
        records = json.loads(text)
    except (RecursionError, ValueError):
        return []
    found = []
    known = records[:MOST_REPLAYED] if isinstance(records, list) else []
    for record in (one for one in known if isinstance(one, dict)):
        with suppress(ValueError):
            found.append(solver_parameters(record))
    return sorted(found, key=lambda solver: solver.time)


@dataclass(frozen=True)
class TopicCount:
    """What became of a topic's messages in a recording."""

    # How many the recorder was given.
    received: int
    # How many of them are in the run.
    written: int
    # How many of them will never be.
    dropped: int = 0
    # How many came during a pause; that is no loss.
    left_out: int = 0
    # How many were lost before, by the numbers of a single publisher; None where nobody can tell.
    unheard: int | None = 0
    # How many publishers that came later had sent before they were heard.
    early: int = 0
    # How many publishers have left: of what each sent last nobody knows.
    left: int = 0

    @property
    def lost(self) -> int | None:
        """Return how many were lost, at least; None where nobody can tell."""
        if self.unheard is None:
            return self.dropped or None
        return self.unheard + self.dropped


@dataclass(frozen=True)
class Pause:
    """A time in which nothing was recorded: by intention, or as the recorder itself stalled."""

    # From and until when [ns since the epoch], on the clock of the log times.
    begin: int
    end: int
    # How many messages of each topic came meanwhile.
    left_out: dict[str, int]
    # Why nothing was recorded; '' for a pause that was requested.
    reason: str = ''


def pause_record(pause: Pause) -> dict[str, str]:
    """Return the metadata record of a pause."""
    left_out = json.dumps(pause.left_out, sort_keys=True)
    reason = {'reason': pause.reason} if pause.reason else {}
    return {'from': str(pause.begin), 'to': str(pause.end), 'left_out': left_out, **reason}


def pause_of(record: Mapping[str, str]) -> Pause:
    """Return a pause from a metadata record; a ValueError if it is none of a pause."""
    try:
        left_out = {name: int(n) for name, n in json.loads(record['left_out']).items()}
        reason = str(record.get('reason', ''))
        return Pause(int(record['from']), int(record['to']), left_out, reason)
    except _GARBLED:
        raise ValueError(f'not a record of a pause: {printable(dict(record))}') from None


@dataclass(frozen=True)
class ToldFinding:
    """What a recorder found, and told, while it recorded."""

    # Which check found it; `trigger` where somebody asked for the run.
    check: str
    # How grave it is, by the name of the severity in a review.
    severity: str
    # What it is.
    text: str
    # When it was first seen [ns since the epoch], on the clock of the log times.
    time: int
    # Of which leg or topic it is; '' for the only one.
    leg: str = ''


def finding_record(finding: ToldFinding) -> dict[str, str]:
    """Return the metadata record of what a recorder found."""
    return {key: str(value) for key, value in asdict(finding).items()}


def told_finding(record: Mapping[str, str]) -> ToldFinding:
    """Return what a recorder found from its metadata record; a ValueError if it is none."""
    try:
        check, severity, text = (str(record[key]) for key in ('check', 'severity', 'text'))
        return ToldFinding(check, severity, text, int(record['time']), str(record['leg']))
    except _GARBLED:
        raise ValueError(f'not a record of a finding: {printable(dict(record))}') from None


def loss_record(counts: Mapping[str, TopicCount]) -> dict[str, str]:
    """Return the metadata record of what became of each topic's messages."""
    told = {name: {**asdict(count), 'lost': count.lost} for name, count in counts.items()}
    return {name: json.dumps(count) for name, count in told.items()}


def harm_record(stopped: str, harms: Iterable[str]) -> dict[str, str]:
    """
    Return the metadata record of what was done to a recording; empty where nothing was.

    Parameters
    ----------
    stopped
        What ended it before anybody asked for its end; '' if nothing did.
    harms
        What somebody took away while it was recorded, a line each.

    """
    told = {'stopped': stopped, 'harmed': '; '.join(harms)}
    return {key: text for key, text in told.items() if text}


def topic_counts(record: Mapping[str, str]) -> dict[str, TopicCount]:
    """Return what became of topics' messages by their record; a ValueError if it is none such."""
    try:
        return {name: _topic_count(json.loads(text)) for name, text in record.items()}
    except _GARBLED:
        raise ValueError(f'not a record of losses: {printable(dict(record))}') from None


def losses(record: Mapping[str, str]) -> dict[str, int | None]:
    """
    Return the lost messages by topic from a metadata record; None where nobody can tell.

    A ValueError says that it is no such record.
    """
    return {name: count.lost for name, count in topic_counts(record).items()}


def _topic_count(data: Mapping[str, Any]) -> TopicCount:
    unheard = data['unheard']
    return TopicCount(
        int(data['received']),
        int(data['written']),
        int(data['dropped']),
        int(data['left_out']),
        None if unheard is None else int(unheard),
        # Recorders before these were counted did not write them.
        int(data.get('early', 0)),
        int(data.get('left', 0)),
    )
