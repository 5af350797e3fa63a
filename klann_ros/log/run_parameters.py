"""Metadata records of a run: solver parameters, pauses, losses, faults and findings."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, fields
import json
from typing import Any, NamedTuple

from klann_ros.messages import STRING
from klann_ros.sanitize.text import parse_json, printable, printable_line
from klann_ros.sanitize.yaml_text import MAX_FILE_SIZE, parameter_file, parse, YamlError

from .records import Message, Topic

SOLVER_RECORD = 'klann_ros.solver'
LOSS_RECORD = 'klann_ros.loss'
FAULT_RECORD = 'klann_ros.fault'
PAUSE_RECORD = 'klann_ros.pause'
RECORDER_RECORD = 'klann_ros.recorder'
FINDING_RECORD = 'klann_ros.finding'
EVENT_RECORD = 'klann_ros.event'
# The solver's parameter with the text of its linkage file; empty for a Klann leg.
LINKAGE_PARAMETER = 'linkage_description'
# The player's parameter with the records of a run's solvers, and their maximum number.
REPLAYED_PARAMETER = 'recorded_solvers'
MAX_REPLAYED_SOLVERS = 64
# The topic on which a solver publishes its parameters, and its type.
DESCRIPTION_TOPIC, STRING_TYPE = 'leg_description', 'std_msgs/msg/String'
_SECTION = 'ros__parameters'
# Refused descriptions that are reported.
_MAX_REFUSALS = 3
# Errors of a malformed record, or of one with infinite numbers.
_RECORD_ERRORS = (AttributeError, KeyError, OverflowError, TypeError, ValueError)


@contextmanager
def _parsing(kind: str, source: object) -> Iterator[None]:
    """Convert errors of a malformed source to a ValueError that says what it should be."""
    try:
        yield
    except YamlError as error:
        raise ValueError(f'not {kind}: {printable(error)}') from None
    except _RECORD_ERRORS:
        raise ValueError(f'not {kind}: {printable(source)}') from None


@dataclass(frozen=True)
class SolverParameters:
    """The parameters of a solver at a time; a run has one record for each known change."""

    # The solver's full name.
    node: str
    # Time of the parameters [ns since the epoch], on the log's clock.
    time: int
    # Numbers, texts, flags and lists of them, by name.
    parameters: dict[str, Any]

    @property
    def without_files(self) -> dict[str, Any]:
        """Return the parameters without names of files: a run must not choose files."""
        return {k: v for k, v in self.parameters.items() if k.rpartition('.')[2] != 'linkage'}


def solver_record(solver: SolverParameters) -> dict[str, str]:
    """Return the metadata record of a solver's parameters."""
    parameters = json.dumps(solver.parameters, sort_keys=True)
    return {'node': solver.node, 'time': str(solver.time), 'parameters': parameters}


def solver_parameters(record: Mapping[str, str]) -> SolverParameters:
    """Return the solver's parameters in a metadata record; raise a ValueError if it is none."""
    with _parsing('a record of a solver', record):
        parameters = dict(parse_json(record['parameters']))
        return SolverParameters(record['node'], int(record['time']), parameters)


def leg_description(solver: SolverParameters) -> str:
    """Return a solver's parameters as a parameter file: the text of `leg_description`."""
    return parameter_file({solver.node: solver.parameters})


def described_solver(text: str, time: int) -> SolverParameters:
    """
    Return the solver that a `leg_description` (untrusted) describes.

    It is a parameter file with the section of one node; a ValueError refuses any other. `time` is
    the log time of the message [ns].
    """
    with _parsing(f'a {DESCRIPTION_TOPIC}', text[:200]):
        ((node, section),) = parse(text).items()
        # YAML has values that no metadata record can hold.
        parameters = dict(json.loads(json.dumps(section[_SECTION])))
        return SolverParameters(str(node), time, parameters)


def is_leg_description(topic: Topic) -> bool:
    """Return whether a topic has the parameters of solvers."""
    return (topic.type, topic.name.rpartition('/')[2]) == (STRING_TYPE, DESCRIPTION_TOPIC)


class DescribedSolvers(NamedTuple):
    """The solvers that messages of `leg_description` describe, and why some describe none."""

    solvers: list[SolverParameters]
    # The first ones, a line each.
    refusals: list[str]


def described_solvers(messages: Iterable[Message]) -> DescribedSolvers:
    """Return the solvers that messages of `leg_description` (untrusted) describe."""
    described = DescribedSolvers([], [])
    last_data = b''
    # All of them may cost as much as one file [bytes].
    size_left = MAX_FILE_SIZE
    for message in messages:
        # A solver repeats it to late subscribers.
        if message.data != last_data and len(message.data) <= size_left:
            last_data = message.data
            size_left -= len(last_data)
            try:
                text = STRING.layout(last_data).texts['data'][0].decode()
                described.solvers.append(described_solver(text, message.log_time))
            except ValueError as error:
                if len(described.refusals) < _MAX_REFUSALS:
                    refusal = f'{message.topic.name} is refused: it is {error}'
                    described.refusals.append(printable_line(refusal))
    return described


def recorded_solvers(records: Iterable[Mapping[str, str]]) -> list[SolverParameters]:
    """Return the solvers in metadata records, by time; skip malformed ones."""
    solvers = []
    for record in records:
        with suppress(ValueError):
            solvers.append(solver_parameters(record))
    return sorted(solvers, key=lambda solver: solver.time)


def replayed_solvers_json(solvers: Sequence[SolverParameters]) -> str:
    """Return a run's last solvers for a player's parameter, as JSON."""
    return json.dumps([solver_record(solver) for solver in solvers[-MAX_REPLAYED_SOLVERS:]])


def replayed_solvers(text: str) -> list[SolverParameters]:
    """Return the solvers in a player's parameter, by time; skip malformed ones (untrusted)."""
    try:
        records = parse_json(text)
    except ValueError:
        return []
    if not isinstance(records, list):
        return []
    last_records = records[:MAX_REPLAYED_SOLVERS]
    return recorded_solvers(record for record in last_records if isinstance(record, dict))


@dataclass(frozen=True)
class TopicCount:
    """Counts of a topic's messages in a recording: received = skipped + dropped + written."""

    received: int
    # Messages in the run.
    written: int
    # Received, but not in the run.
    dropped: int = 0
    # Received during a pause, which is no loss.
    skipped: int = 0
    # Lost before reception, by gaps in sequence numbers; None if unknown.
    missed: int | None = 0
    # Sent by later publishers before they were discovered.
    before_discovery: int = 0
    # Publishers that left: losses at their end cannot be detected.
    departed: int = 0

    @property
    def lost(self) -> int | None:
        """Return the lost messages, at least; None if unknown."""
        if self.missed is None:
            return self.dropped or None
        return self.missed + self.dropped


@dataclass(frozen=True)
class Pause:
    """A time without recording: on request, or because the recorder stalled."""

    # [ns since the epoch], on the log's clock.
    begin: int
    end: int
    # Messages of each topic received meanwhile.
    skipped: dict[str, int]
    # '' for a pause on request.
    reason: str = ''


def pause_record(pause: Pause) -> dict[str, str]:
    """Return the metadata record of a pause."""
    skipped = json.dumps(pause.skipped, sort_keys=True)
    reason = {'reason': pause.reason} if pause.reason else {}
    return {'from': str(pause.begin), 'to': str(pause.end), 'skipped': skipped, **reason}


def recorded_pause(record: Mapping[str, str]) -> Pause:
    """Return the pause in a metadata record; raise a ValueError if it is none."""
    with _parsing('a record of a pause', record):
        skipped = {name: int(n) for name, n in parse_json(record['skipped']).items()}
        reason = str(record.get('reason', ''))
        return Pause(int(record['from']), int(record['to']), skipped, reason)


@dataclass(frozen=True)
class RecordedFinding:
    """A finding of the recorder's live review."""

    # Name of the check; `trigger` for a call of ~/trigger.
    check: str
    # Name of the severity in a review.
    severity: str
    text: str
    # First occurrence [ns since the epoch], on the log's clock.
    time: int
    # Its leg or topic; '' for the only one.
    leg: str = ''


def finding_record(finding: RecordedFinding) -> dict[str, str]:
    """Return the metadata record of a finding."""
    return {key: str(value) for key, value in asdict(finding).items()}


def recorded_finding(record: Mapping[str, str]) -> RecordedFinding:
    """Return the finding in a metadata record; raise a ValueError if it is none."""
    with _parsing('a record of a finding', record):
        check, severity, text = (str(record[key]) for key in ('check', 'severity', 'text'))
        return RecordedFinding(check, severity, text, int(record['time']), str(record['leg']))


def loss_record(counts: Mapping[str, TopicCount]) -> dict[str, str]:
    """Return the metadata record of each topic's counts."""
    return {
        name: json.dumps({**asdict(count), 'lost': count.lost}) for name, count in counts.items()
    }


def fault_record(stopped: str, faults: Iterable[str]) -> dict[str, str]:
    """
    Return the metadata record of a recording's faults; empty without any.

    `stopped` is the error that ended it early, '' without one; `faults` are outside changes of the
    run, one line each.
    """
    record = {'stopped': stopped, 'faults': '; '.join(faults)}
    return {key: text for key, text in record.items() if text}


def topic_counts(record: Mapping[str, str]) -> dict[str, TopicCount]:
    """Return each topic's counts in a metadata record; raise a ValueError if it is none."""
    with _parsing('a record of losses', record):
        return {name: _topic_count(parse_json(text)) for name, text in record.items()}


def _topic_count(counts: Mapping[str, Any]) -> TopicCount:
    missed = counts['missed']
    names = [field.name for field in fields(TopicCount) if field.name != 'missed']
    numbers = {name: int(counts[name]) for name in names}
    return TopicCount(**numbers, missed=None if missed is None else int(missed))
