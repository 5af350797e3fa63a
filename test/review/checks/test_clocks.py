"""Latency of latched messages, which wait for the recorder."""

import json
from pathlib import Path
import re

from klann_ros.log.definitions import definition
from klann_ros.log.qos import Qos, qos_to_yaml
from klann_ros.log.records import Message, Topic
from klann_ros.review.command import main
from klann_ros.review.page.data import timing
from klann_ros.review.reviewing import review_run
import pytest

FLOAT = 'std_msgs/msg/Float64'


def latched(make_run, healthy, *sent: tuple[float, float, int]) -> Path:
    """Return a run with a latched topic too: publish and log time [s], sequence number."""
    qos = qos_to_yaml([Qos(durability='transient_local')])
    topic = Topic('/markers', FLOAT, definition(FLOAT), qos=qos)
    start = healthy.answers[0].stamp
    for publish_time, log_time, number in sent:
        times = start + round(log_time * 1e9), start + round(publish_time * 1e9)
        healthy.messages.append(Message(topic, bytes(12), *times, number))
    return make_run(healthy)


def test_messages_latched_before_discovery_have_no_latency(healthy, make_run) -> None:
    sent = [(-9.0, 0.1, 3), (-8.0, 0.1, 4), (0.5, 0.503, 5), (1.0, 1.001, 6)]
    # Another one, whose first message waited as well; and the third.
    sent += [(1.1, 1.4, 1), (1.5, 1.502, 2), (1.6, 1.9, 2)]
    review = review_run(latched(make_run, healthy, *sent))
    (figures,) = [topic for topic in review.topics if topic.name == '/markers']
    assert figures.latency_p50 == pytest.approx(0.002)
    assert figures.latency_p99 == pytest.approx(0.003, rel=0.02)
    assert review.findings == ()


def test_no_latency_is_shown_where_none_is_known(healthy, make_run, capsys, tmp_path) -> None:
    run = latched(make_run, healthy, *((n - 20.0, 0.1 + n, n + 1) for n in range(12)))
    report = tmp_path / 'report.json'
    assert main([str(run), '--json', str(report), '--details']) == 0
    assert re.search(r'^/markers +12 .* - +- +0$', capsys.readouterr().out, re.MULTILINE)
    (topic,) = [t for t in json.loads(report.read_text())['topics'] if t['name'] == '/markers']
    assert (topic['latency_p50'], topic['latency_p99']) == (None, None)
    (recorded,) = [t for t in review_run(run).recording.topics if t.name == '/markers']
    assert timing(recorded)['latencies']['text'] == 'There is none.'
