"""Events: what came before and after a cause is in a run of its own, whole and accounted for."""

from collections.abc import Iterator
from pathlib import Path
from threading import Event
import time

from klann_ros.log.errors import LowSpaceError
from klann_ros.log.qos import Qos, qos_to_yaml
from klann_ros.log.reader import open_log
from klann_ros.log.records import Message, Topic
from klann_ros.log.run_parameters import (
    EVENT_RECORD,
    FINDING_RECORD,
    LOSS_RECORD,
    Pause,
    PAUSE_RECORD,
    recorded_finding,
    RecordedFinding,
    SOLVER_RECORD,
    SolverParameters,
    topic_counts,
    TopicCount,
)
from klann_ros.log.write import recording
from klann_ros.log.write.background_writer import BackgroundWriter, MESSAGE_OVERHEAD
from klann_ros.log.write.event_session import EventSession, EventSettings
from klann_ros.log.write.ring_buffer import MAX_LATCHED_MESSAGES, RingBuffer
from klann_ros.log.write.writer import RunWriter
import pytest

LATCHED = qos_to_yaml([Qos(durability='transient_local')])
CRANK, MODEL = Topic('/crank_angle', 'a/msg/A'), Topic('/model', 'a/msg/A', qos=LATCHED)


def message(number: int, topic: Topic = CRANK, size: int = 8) -> Message:
    data = number.to_bytes(8, 'little') + bytes(size - 8)
    return Message(topic, data, time.time_ns(), number, number)


class Stage:
    """A session with a clock, a disk, its reports, and the reception of a recorder."""

    def __init__(self, folder: Path, monkeypatch) -> None:
        self.folder, self.now, self.next = folder, 1000.0, 1
        monkeypatch.setattr('klann_ros.log.write.event_session.monotonic', lambda: self.now)
        self.reports: list[tuple[bool, str]] = []
        self.refusal: Exception | None = None
        self.disk = Event()
        self.disk.set()
        self.session = EventSession(
            folder,
            EventSettings(3.0, 2.0, 10_000_000),
            open_run=self.open_run,
            on_status=lambda ok, text: self.reports.append((ok, text)),
        )

    def receive(self, count: int = 1, topic: Topic = CRANK) -> range:
        """Count each message as received, and pass it on."""
        first = self.next
        for _ in range(count):
            counters = self.session.counters[topic.name]
            counters.loss.count(self.next)
            counters.received += 1
            if not self.session.pauses.skips(counters, time.time_ns()):
                self.session.put(message(self.next, topic))
            self.next += 1
        return range(first, self.next)

    def open_run(self, path: Path) -> tuple[RunWriter, BackgroundWriter]:
        if self.refusal is not None:
            raise self.refusal
        assert self.disk.wait(30.0)
        run = RunWriter(path)
        return run, BackgroundWriter(run, flush_period=0.05, on_failure=lambda: None)

    def wait(self, seconds: float) -> None:
        """Let time pass, as a recorder does: tick by tick."""
        self.until_open()
        for _ in range(round(seconds / 0.25)):
            self.now += 0.25
            self.session.tick()

    def until_open(self) -> None:
        """Wait for a busy machine to open the run, unless its disk is stopped."""
        end = time.monotonic() + 30.0
        while self.session._opening is not None and self.disk.is_set():
            assert time.monotonic() < end
            time.sleep(0.01)
            self.session.tick()

    def until_closed(self) -> None:
        end = time.monotonic() + 30.0
        while self.session._closing is not None:
            assert time.monotonic() < end
            time.sleep(0.01)
            self.session.tick()

    def runs(self) -> list[Path]:
        return sorted(self.folder.iterdir())

    def event(self) -> Path:
        """Let the event end; return its run, the last one."""
        self.wait(2.5)
        self.until_closed()
        return self.runs()[-1]


@pytest.fixture
def stage(tmp_path, monkeypatch) -> Iterator[Stage]:
    new_stage = Stage(tmp_path, monkeypatch)
    yield new_stage
    new_stage.session.finish()


def numbers(run: Path, topic: str = CRANK.name) -> list[int]:
    with open_log(run) as log:
        assert log.complete, log.problem
        return [message.sequence for message in log.messages([topic])]


def metadata(run: Path) -> dict[str, list[dict[str, str]]]:
    with open_log(run) as log:
        return log.metadata


def counts(run: Path) -> dict[str, TopicCount]:
    return topic_counts(metadata(run)[LOSS_RECORD][0])


GAP = RecordedFinding('gap', 'warning', 'nothing on /crank_angle', 17, '/crank_angle')


def test_nothing_is_written_without_a_cause(stage: Stage) -> None:
    stage.receive(100)
    stage.wait(10.0)
    assert stage.session.finish() == (True, 'no trigger occurred; nothing was written')
    assert stage.runs() == []


def test_an_event_run_holds_exactly_pre_and_post_trigger_messages(stage: Stage) -> None:
    received = {}
    for second in range(12):
        received[second] = stage.receive(10)
        stage.wait(1.0)
        if second == 7:
            stage.session.add_finding(GAP)
    stage.until_closed()
    (run,) = stage.runs()
    assert run.name.endswith('_gap')
    recorded_numbers = numbers(run)
    # Three seconds before, two after; and no more than a little beside.
    event_numbers = [number for second in (5, 6, 7, 8, 9) for number in received[second]]
    assert set(event_numbers) <= set(recorded_numbers)
    assert recorded_numbers == [*range(recorded_numbers[0], recorded_numbers[-1] + 1)]
    assert recorded_numbers[0] >= received[3][0]
    assert recorded_numbers[-1] <= received[10][-1]
    (record,) = metadata(run)[FINDING_RECORD]
    assert recorded_finding(record) == GAP
    (event,) = metadata(run)[EVENT_RECORD]
    assert (event['cause'], event['evicted']) == ('gap', '0')
    count = counts(run)[CRANK.name]
    assert count.received == count.written == len(recorded_numbers)
    assert (count.lost, count.dropped, count.skipped) == (0, 0, 0)


def test_after_an_event_it_is_armed_again_with_a_new_pre_trigger(stage: Stage) -> None:
    stage.receive(10)
    stage.session.add_finding(GAP)
    first = stage.event()
    later = stage.receive(10)
    assert stage.session.trigger()[0]
    second = stage.event()
    assert numbers(first) == [*range(1, 11)]
    # What is not too long ago is in both.
    assert numbers(second) == [*range(1, 11), *later]
    assert second.name.endswith('_trigger')
    assert stage.session.finish()[1].startswith('2 events in ')


def test_a_cause_during_an_event_lets_it_last_longer(stage: Stage) -> None:
    stage.session.add_finding(GAP)
    stage.wait(1.5)
    done, said = stage.session.trigger()
    assert done
    assert said.endswith(' (extended)')
    stage.wait(1.75)
    received = stage.receive(5)
    stage.wait(2.0)
    stage.until_closed()
    (run,) = stage.runs()
    assert numbers(run) == [*received]
    assert [record['check'] for record in metadata(run)[FINDING_RECORD]] == ['gap', 'trigger']


def test_latched_topics_and_solvers_are_in_every_run_however_old(stage: Stage) -> None:
    stage.session.add_solver(SolverParameters('/solver', 1, {'l_ab': 1.0}))
    stage.session.add_solver(SolverParameters('/solver', 2, {'l_ab': 2.0}))
    stage.receive(1, MODEL)
    stage.wait(100.0)
    stage.receive(10)
    stage.session.trigger()
    run = stage.event()
    assert numbers(run, MODEL.name) == [1]
    (record,) = metadata(run)[SOLVER_RECORD]
    assert '2.0' in record['parameters']
    with open_log(run) as log:
        # As if it had been received then, so that the run does not begin long before.
        assert log.end_time - log.start_time < 10**9
    count = counts(run)[MODEL.name]
    assert (count.received, count.written) == (1, 1)


def test_a_pause_is_in_the_run_and_in_its_account(stage: Stage) -> None:
    stage.receive(5)
    stage.session.pauses.begin(time.time_ns())
    stage.receive(7)
    assert stage.session.trigger() == (False, 'it is paused')
    stage.session.pauses.end(time.time_ns())
    stage.session.add_pause(stage.session.pauses.take_last())
    stage.receive(5)
    stage.session.trigger()
    run = stage.event()
    count = counts(run)[CRANK.name]
    assert (count.received, count.written, count.skipped) == (17, 10, 7)
    assert len(metadata(run)[PAUSE_RECORD]) == 1


def test_losses_before_the_pre_trigger_are_not_counted(stage: Stage) -> None:
    stage.receive(5)
    stage.next += 100
    stage.receive(5)
    stage.wait(10.0)
    stage.receive(5)
    stage.next += 3
    stage.receive(5)
    stage.session.trigger()
    stage.session.finish()
    (run,) = stage.runs()
    count = counts(run)[CRANK.name]
    assert (count.received, count.written, count.lost) == (10, 10, 3)


def test_a_disk_error_is_reported_and_the_next_event_is_recorded(stage: Stage) -> None:
    stage.refusal = LowSpaceError(stage.folder, 1, 2)
    stage.session.add_finding(GAP)
    assert 'gap) is not recorded' in stage.session.state().faults[0]
    assert stage.session.trigger()[0] is False
    stage.refusal = None
    stage.session.add_finding(GAP)
    stage.event()
    assert len(stage.runs()) == 1
    assert stage.session.state().faults == ()
    # Something is missing all the same.
    assert stage.session.finish()[0] is False


@pytest.mark.parametrize('is_ended', [False, True])
def test_a_disk_that_takes_its_time_to_open_a_run_holds_nothing_up(
    stage: Stage, *, is_ended: bool
) -> None:
    stage.disk.clear()
    first_numbers = stage.receive(10)
    stage.session.add_finding(GAP)
    # Longer than is held otherwise; who waited for the disk would not come to this.
    received = [first_numbers]
    for _ in range(6):
        received.append(stage.receive(10))
        stage.wait(1.0)
    stage.session.add_finding(GAP)
    assert stage.session.state().stage == 'opening the run of an event'
    assert stage.session.trigger()[1].endswith('which a slow disk is still opening')
    assert stage.runs() == []
    stage.disk.set()
    if is_ended:
        stage.session.finish()
    else:
        while stage.session._event is None:
            time.sleep(0.01)
            stage.session.tick()
        received.append(stage.receive(10))
        stage.wait(3.0)
        stage.until_closed()
    (run,) = stage.runs()
    assert numbers(run) == [number for second_numbers in received for number in second_numbers]
    checks = [recorded_finding(record).check for record in metadata(run)[FINDING_RECORD]]
    assert checks == ['gap', 'gap', 'trigger']


def test_two_events_within_a_second_have_names_of_their_own(stage: Stage) -> None:
    for _ in range(3):
        stage.session.trigger()
        stage.event()
    assert len(stage.runs()) == 3


@pytest.mark.parametrize('cause', ['../../etc', 'a/b', '\n\x1b[31m', '', 'x' * 500])
def test_whatever_a_cause_is_called_its_run_is_in_the_folder(stage: Stage, cause: str) -> None:
    stage.session.add_finding(RecordedFinding(cause, 'error', 'what', 1))
    stage.session.finish()
    (run,) = stage.runs()
    assert run.parent == stage.folder
    assert numbers(run) == []


def ring_buffer(max_bytes: int) -> RingBuffer:
    return RingBuffer(10.0, max_bytes, lambda: {CRANK.name: TopicCount(0, 0)}, 0.0)


def test_a_ring_buffer_respects_its_memory_limit_and_counts_evictions() -> None:
    max_bytes = 1_000_000
    buffer = ring_buffer(max_bytes)
    for number in range(10_000):
        buffer.put(message(number, size=1000))
        assert buffer.size <= max_bytes * 1.1
    kept = [kept_message.sequence for kept_message in buffer.messages()]
    assert kept == [*range(10_000 - len(kept), 10_000)]
    assert buffer.evicted == 10_000 - len(kept)
    assert len(kept) * (1000 + MESSAGE_OVERHEAD) > 0.8 * max_bytes


def test_of_a_latched_topic_the_last_ones_outlive_their_time_within_bounds() -> None:
    buffer = ring_buffer(1_000_000)
    for number in range(1000):
        buffer.put(message(number, MODEL, 100))
    buffer.rotate(1.0, 1.0)
    buffer.rotate(100.0, 100.0)
    buffer.rotate(200.0, 200.0)
    assert [*buffer.messages()] == []
    kept = buffer.latched(5)
    assert [latched.sequence for latched in kept] == [*range(1000 - MAX_LATCHED_MESSAGES, 1000)]
    assert {latched.log_time for latched in kept} == {5}


@pytest.mark.parametrize(
    ('newest', 'first'), [(10.9, 0), (11.0, 1), (11.9, 1), (12.0, 2), (100.0, 3)]
)
def test_a_segment_leaves_when_the_next_one_is_as_old_as_the_buffer(
    newest: float, first: int
) -> None:
    buffer = ring_buffer(1_000_000)
    for second in range(3):
        buffer.put(message(second))
        buffer.rotate(second + 1.0, second + 1.0)
    buffer.rotate(newest, newest)
    assert [buffered.sequence for buffered in buffer.messages()] == [*range(first, 3)]


def test_the_size_is_that_of_the_messages_in_all_segments() -> None:
    buffer = ring_buffer(1_000_000)
    sizes = [buffer.size]
    for number in range(3):
        buffer.put(message(number, size=600))
        sizes.append(buffer.size)
        buffer.rotate(0.25 * number, 0.25 * number)
    assert sizes == [number * (600 + MESSAGE_OVERHEAD) for number in range(4)]


@pytest.mark.parametrize(('size', 'count'), [(25_000, 5), (25_001, 4), (125_000, 1), (200_000, 1)])
def test_latched_messages_take_an_eighth_of_the_memory_and_are_one_at_least(
    size: int, count: int
) -> None:
    buffer = ring_buffer(1_000_000)
    for number in range(8):
        buffer.put(message(number, MODEL, size - MESSAGE_OVERHEAD))
        buffer.rotate(100.0 * number, 100.0 * number)
    buffer.rotate(1000.0, 1000.0)
    assert [latched.sequence for latched in buffer.latched(5)] == [*range(8 - count, 8)]


@pytest.mark.parametrize(('age', 'is_recorded'), [(3.0, True), (4.0, True), (4.25, False)])
def test_the_pre_trigger_counts_from_before_the_latest_finding(
    stage: Stage, *, age: float, is_recorded: bool
) -> None:
    received = [*stage.receive(1)]
    stage.wait(age)
    stage.session.add_finding(GAP)
    assert numbers(stage.event()) == (received if is_recorded else [])


@pytest.mark.parametrize(('delay', 'is_recorded'), [(2.0, True), (2.25, False)])
def test_an_event_waits_for_the_reception_of_its_last_messages(
    stage: Stage, *, delay: float, is_recorded: bool
) -> None:
    stage.session.add_finding(GAP)
    stage.wait(delay)
    received = [*stage.receive(1)]
    assert numbers(stage.event()) == (received if is_recorded else [])


@pytest.mark.parametrize(('wait', 'count'), [(0.0, 1), (4.0, 1), (4.5, 0)])
def test_a_pause_before_the_buffer_is_not_in_the_run(
    stage: Stage, wait: float, count: int
) -> None:
    stage.session.add_pause(Pause(1, 2, {}, ''))
    stage.wait(wait)
    stage.session.trigger()
    assert len(metadata(stage.event()).get(PAUSE_RECORD, ())) == count


@pytest.mark.parametrize(('ages', 'count'), [((9.0, 8.0), 1), ((9.0, 0.5), 2), ((1.0, 0.5), 2)])
def test_the_solver_parameters_of_the_buffered_time_are_in_the_run(
    stage: Stage, ages: tuple[float, ...], count: int
) -> None:
    stage.wait(10.0)
    for age in ages:
        begin = time.time_ns() - round(age * 1e9)
        stage.session.add_solver(SolverParameters('/solver', begin, {'l_ab': age}))
    stage.wait(0.25)
    stage.session.trigger()
    assert len(metadata(stage.event())[SOLVER_RECORD]) == count


def test_findings_in_a_run_are_limited(stage: Stage, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recording, 'MAX_FINDINGS', 3)
    for _ in range(5):
        stage.session.add_finding(GAP)
    assert len(metadata(stage.event())[FINDING_RECORD]) == 3


@pytest.mark.parametrize(('wait', 'is_reported'), [(0.0, True), (2.75, True), (3.0, False)])
def test_an_eviction_is_reported_while_the_pre_trigger_is_incomplete(
    stage: Stage, *, wait: float, is_reported: bool
) -> None:
    stage.wait(10.0)
    for _ in range(20):
        stage.session.put(message(1, size=1_000_000))
    stage.wait(wait)
    stage.session.trigger()
    assert any('still in memory' in text for _, text in stage.reports) == is_reported
