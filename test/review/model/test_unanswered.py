"""The number of crank angles without an answer is true, whatever became of the others."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from io import BytesIO
from itertools import accumulate
import json
from pathlib import Path
import re
import struct
from typing import Any

from hypothesis import example, given, settings, strategies as st
from klann_ros.kinematics import KlannGeometry
from klann_ros.log.records import Message
from klann_ros.log.run_parameters import (
    Pause,
    PAUSE_RECORD,
    pause_record,
    SOLVER_RECORD,
    solver_record,
    SolverParameters,
)
from klann_ros.log.write.writer import RunWriter
from klann_ros.review.report.data import save_json
from klann_ros.review.reviewing import review_run
from leg_runs import START
import pytest

COUNT = 200
PERIOD = 5_000_000
# Not the first and the last: what is cut off by the edges is no question.
INSIDE = st.integers(1, COUNT - 2)


@dataclass
class Fates:
    """What becomes of each question of a run, by its number."""

    unanswered: set[int]
    silent: range
    lost: set[int]
    paused: range
    unheard: set[int]

    def has_question(self, n: int) -> bool:
        return n not in self.paused and n not in self.unheard

    def is_answered(self, n: int) -> bool:
        return n not in self.unanswered and n not in self.silent

    def has_answer(self, n: int) -> bool:
        return self.is_answered(n) and n not in self.lost and n not in self.paused


@st.composite
def fates(draw: Any) -> Fates:
    def stretch(min_size: int) -> range:
        begin = draw(INSIDE)
        size = draw(st.one_of(st.just(0), st.integers(min_size, 60)))
        return range(begin, min(begin + size, COUNT - 1))

    singles = st.sets(INSIDE, max_size=12)
    return Fates(draw(singles), stretch(15), draw(singles), stretch(5), draw(singles))


Messages = list[Message]


def changed(messages: Messages, fate: Fates) -> Messages:
    """Return the messages of a run in which the questions have these fates."""
    answered = list(accumulate(map(fate.is_answered, range(COUNT))))
    recorded = []
    for message in messages:
        n = message.sequence - 1
        if message.topic.name in ('/crank_angle', '/crank_state'):
            if fate.has_question(n):
                recorded.append(message)
        elif fate.has_answer(n):
            recorded.append(replace(message, sequence=answered[n]))
    return recorded


class Runs:
    """Writes runs in which the questions of a healthy one have some fates."""

    def __init__(self, folder: Path, messages: Messages) -> None:
        self._folder = folder
        self._count = 0
        self.healthy = messages

    def write(self, fate: Fates, changed_: Callable[[Message], Message] = lambda m: m) -> Path:
        self._count += 1
        run = self._folder / str(self._count)
        with RunWriter(run) as writer:
            parameters = KlannGeometry().as_dict()
            record = solver_record(SolverParameters('/solver_node', 0, parameters))
            writer.add_metadata(SOLVER_RECORD, record)
            if fate.paused:
                times = [m.log_time for m in self.healthy if m.sequence - 1 in fate.paused]
                pause = Pause(min(times), max(times), {})
                writer.add_metadata(PAUSE_RECORD, pause_record(pause))
            for message in changed(self.healthy, fate):
                writer.write(changed_(message))
        return run


@pytest.fixture(scope='module')
def runs(tmp_path_factory: pytest.TempPathFactory, make_script: Any, messages_of: Any) -> Runs:
    messages = [*messages_of(make_script(turns=1.0, count=COUNT))]
    return Runs(tmp_path_factory.mktemp('fates'), messages)


@pytest.fixture(scope='module')
def stamped_runs(
    tmp_path_factory: pytest.TempPathFactory, make_script: Any, messages_of: Any
) -> Runs:
    """Return runs whose questions have stamps of their own."""
    messages = [*messages_of(make_script(turns=1.0, count=COUNT).by_crank_state())]
    return Runs(tmp_path_factory.mktemp('stamped'), messages)


@settings(max_examples=20, deadline=None)
@given(fate=fates())
@example(fate=Fates(set(), range(0), set(), range(0), set()))
@example(fate=Fates({50}, range(60, 90), {120, 121}, range(150, 160), {51, 170}))
def test_the_number_of_unanswered_crank_angles_is_true(runs: Runs, fate: Fates) -> None:
    review = review_run(runs.write(fate))
    (leg,) = review.legs
    asked = [n for n in range(COUNT) if fate.has_question(n)]
    truth = [n for n in asked if not fate.has_answer(n)]
    missing = leg.unanswered
    assert (leg.answers.asked, leg.answers.count) == (len(asked), len(asked) - len(truth))
    assert missing.count == len(truth)
    shares = (missing.in_gaps, missing.unrecorded, missing.lost, missing.unexplained)
    assert sum(shares) == len(truth)
    assert min(shares) >= 0
    assert missing.lost <= len(fate.lost)
    for finding in review.findings:
        if finding.check == 'answers':
            whole, _, parts = finding.text.partition(' not answered')
            numbers = re.findall(r'[0-9]+(?= (?:in|at|whose|unexplained))', parts)
            assert int(whole.split()[0]) == len(truth)
            assert sum(map(int, numbers)) == (len(truth) if parts else 0)


def test_questions_within_0_2_s_of_a_pause_are_at_holes(runs: Runs) -> None:
    fate = Fates({58, 62, 147, 152}, range(0), set(), range(100, 110), set())
    (leg,) = review_run(runs.write(fate)).legs
    assert (leg.unanswered.unrecorded, leg.unanswered.unexplained) == (2, 2)


@settings(max_examples=10, deadline=None)
@given(single=st.sets(INSIDE, max_size=40), at_once=st.integers(1, 7))
def test_of_questions_with_one_stamp_as_many_are_missing_as_answers_are(
    stamped_runs: Runs, single: set[int], at_once: int
) -> None:
    fate = Fates(single, range(0), set(), range(0), set())

    def stamped(message: Message) -> Message:
        n = (message.publish_time - START) // PERIOD
        stamp = struct.pack('<iI', 5 + n // at_once, 0)
        return replace(message, data=message.data[:4] + stamp + message.data[12:])

    review = review_run(stamped_runs.write(fate, stamped))
    (leg,) = review.legs
    assert leg.answers.asked == COUNT
    assert leg.unanswered.count == len(single)


def test_the_report_for_machines_has_all_parts(healthy, make_run) -> None:
    healthy.silence(200, 250)
    for index, later in ((30, 1000), (31, 1000), (0, -1000)):
        healthy.ask(index, later)
    file = BytesIO()
    save_json(review_run(make_run(healthy)), None, file)
    (leg,) = json.loads(file.getvalue())['legs']
    assert leg['crank_angles'] == {
        'before_the_first_answer': 1,
        'asked': 402,
        'answered': 350,
        'no_angle': 0,
        'out_of_reach': 0,
        'unanswered_in_gaps': 50,
        'unanswered_while_unrecorded': 0,
        'unanswered_by_lost_answers': 0,
        'unanswered_unexplained': 2,
        'after_the_last_answer': 0,
    }
