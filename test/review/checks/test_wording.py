"""Of one thing nothing is said in the plural, whatever is found."""

from collections.abc import Callable
from dataclasses import replace
import math
import re
from typing import Any

from klann_ros.kinematics import KlannGeometry, KlannLeg
from klann_ros.log.run_parameters import LOSS_RECORD, loss_record, TopicCount
from klann_ros.review.command import main
import pytest

# One of something, and not one of several: 1 messages, 1 poses were.
PLURAL = re.compile(r'(?<![\d.])1 (?!of )(?:\w+ )?(?:\w+[^s\d\W]s|feet|were|are|have|do)\b')


def one_lost(script: Any) -> None:
    counts = {
        '/crank_angle': TopicCount(400, 399, missed=1, before_discovery=1, departed=1),
        '/point_h': TopicCount(400, 400, missed=0, departed=2),
    }
    script.metadata.append((LOSS_RECORD, loss_record(counts)))


def one_unanswered(script: Any) -> None:
    script.ask(30)


def one_that_is_none(script: Any) -> None:
    script.unanswered.append((script.answers[30].stamp + 1000, math.nan))


def one_out_of_reach(script: Any) -> None:
    script.geometry = KlannGeometry(l_dc=0.12)
    leg = KlannLeg(script.geometry)
    for n in range(400):
        pose = leg.closed_form(1.0 + n / 1000)
        script.change(n, alpha=pose.alpha, pose=list(pose.joints), foot=pose.h)
    script.unanswered.append((script.answers[300].stamp + 1000, 2.6))


def one_wrong_pose(script: Any) -> None:
    script.answers[100].pose[2] += 1e-3


def one_that_is_not_finite(script: Any) -> None:
    script.answers[100].pose[2] = math.nan


def one_flipped(script: Any) -> None:
    pose = KlannLeg(KlannGeometry(assembly=(1, -1))).solve(script.answers[100].alpha)
    script.change(100, pose=list(pose.joints), foot=pose.h)


def one_foot(script: Any) -> None:
    script.change(100, foot=(0.5, 0.5))


def one_foot_that_is_none(script: Any) -> None:
    script.change(100, foot=(math.nan, 0.5))


def one_for_another_angle(script: Any) -> None:
    pose = KlannLeg().solve(script.answers[100].alpha + 1e-6)
    script.change(100, pose=list(pose.joints), foot=pose.h)


def one_jump(script: Any) -> None:
    for n in range(200, 400):
        script.move(n, script.answers[n].alpha + 1.0)


def one_stamp_back(script: Any) -> None:
    script.by_crank_state()
    script.swap_stamps(100, 101)


def one_answer_again(script: Any) -> None:
    again = replace(script, answers=[script.answers[50]], metadata=[], others=[], geometry=None)
    again.crank, again.latency = replace(script.crank, name='/other'), 1_200_000
    script.others.append(again)


def one_garbled(script: Any) -> None:
    script.messages.append(
        replace(script_message(script), data=bytes([0, 1, 0, 0, 1]), sequence=401)
    )


def script_message(script: Any) -> Any:
    script.ask_unstamped(399)
    return script.messages.pop()


def one_in_a_silence(script: Any) -> None:
    for n in range(200, 220):
        script.unanswered.append((script.answers[n].stamp, script.answers[n].alpha))
    # One of them is in it.
    del script.unanswered[:-1]
    del script.answers[200:220]
    script.renumber()


def one_after_the_end(script: Any) -> None:
    last = script.answers[-1]
    script.unanswered.append((last.stamp + 2_100_000_000, last.alpha))


def one_pose(script: Any) -> None:
    script.answers = script.answers[:1]


CASES = [value for name, value in sorted(globals().items()) if name.startswith('one_')]


@pytest.mark.parametrize('change', CASES, ids=lambda change: change.__name__)
def test_of_one_nothing_is_said_in_the_plural(
    healthy: Any, make_run: Any, capsys: Any, change: Callable[[Any], None]
) -> None:
    change(healthy)
    main([str(make_run(healthy))])
    output = capsys.readouterr().out
    assert change is one_pose or re.search('^(ERROR|WARNING|NOTE) ', output, re.MULTILINE)
    assert PLURAL.findall(output) == []


def test_a_plural_of_one_is_seen() -> None:
    for said in ('1 messages of', 'and 1 poses', ': 1 crank angles', '1 were', ' 1 feet'):
        assert PLURAL.search(said), said
    for said in ('1 of 400 poses is', '11 messages', '0.1 s after', '1 message of', '1 stamp is'):
        assert not PLURAL.search(said), said
