"""Log times that go back: publishers whose messages overtake each other, and clocks set back."""

from dataclasses import replace
import struct

from hypothesis import example, given, settings, strategies as st
from klann_ros.log.records import Message, Topic
from klann_ros.log.run_parameters import TopicCount
from klann_ros.review.load.topics import recorder_clock_steps
from klann_ros.review.reviewing import review_run
import numpy as np
import pytest
from review_findings import checks, found as findings_of

MS = 1_000_000
S = 1000 * MS


def recorded_times(
    seed: int, *, publishers: int, behind: int, batch: int, count: int = 3000, late: int = 3 * MS
) -> tuple[np.ndarray, np.ndarray]:
    """
    Return source and received times of a recorder: a queue in the order of sources.

    Each publisher sends at 500 Hz; now and then a message comes late, and whatever its publisher
    sent after it comes after it. The clock of the second is `behind` [ns].
    """
    random = np.random.default_rng(seed)
    messages = []
    for publisher in range(publishers):
        sent = np.arange(count) * 2 * MS + random.integers(0, MS, count)
        latency = 50_000 + random.integers(0, 200_000, count)
        latency += (random.random(count) < 0.02) * random.integers(0, late, count)
        received = np.maximum.accumulate(sent + latency)
        messages.append(np.column_stack([sent - behind * (publisher == 1), received]))
    sources, received = np.concatenate(messages).T
    # What was received by the same wake-up is in the queue together.
    order = np.lexsort([sources, received // batch])
    return sources[order], received[order]


def steps(sources: np.ndarray, received: np.ndarray) -> np.ndarray:
    rows = np.flatnonzero(np.diff(received) < 0)
    return np.column_stack([rows + 1, -np.diff(received)[rows], -np.diff(sources)[rows]])


def clocks(sources: np.ndarray, received: np.ndarray, *, alone: bool) -> np.ndarray:
    latencies = ((received - sources) / 1e9).astype(np.float32)
    back = steps(sources, received)
    return back[recorder_clock_steps(latencies, back, alone=alone), 0]


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 2**32),
    publishers=st.integers(2, 4),
    behind=st.sampled_from([0, 3 * MS, 300 * MS, -5 * S, 3600 * S]),
    batch=st.sampled_from([1 * MS, 20 * MS, 1300 * MS]),
)
@example(seed=0, publishers=2, behind=300 * MS, batch=1300 * MS)
def test_interleaved_publishers_are_not_a_clock_jump(
    seed: int, publishers: int, behind: int, batch: int
) -> None:
    sources, received = recorded_times(seed, publishers=publishers, behind=behind, batch=batch)
    assert not len(clocks(sources, received, alone=False))


def test_such_publishers_do_go_back_in_the_log() -> None:
    sources, received = recorded_times(1, publishers=2, behind=300 * MS, batch=20 * MS)
    assert len(steps(sources, received)) > 100


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 2**32),
    publishers=st.integers(1, 3),
    index=st.integers(500, 2500),
    offset=st.sampled_from([30 * MS, 200 * MS, 5 * S, 3600 * S]),
)
def test_a_clock_that_is_set_back_is_found_where_that_was(
    seed: int, publishers: int, index: int, offset: int
) -> None:
    sources, received = recorded_times(
        seed, publishers=publishers, behind=0, batch=20 * MS, late=MS
    )
    index *= publishers
    received[index:] -= offset
    assert clocks(sources, received, alone=publishers == 1).tolist() == [index]


@pytest.mark.parametrize('offset', [30 * MS, 200 * MS, 5 * S])
def test_a_machine_whose_clock_is_set_back_is_found(offset: int) -> None:
    sources, received = recorded_times(2, publishers=1, behind=0, batch=20 * MS)
    sources[700:] -= offset
    received[700:] -= offset
    assert clocks(sources, received, alone=True).tolist() == [700]


def test_a_repeated_message_is_not_a_clock_jump() -> None:
    sources, received = recorded_times(3, publishers=1, behind=0, batch=20 * MS)
    received[800] += 400 * MS
    assert len(steps(sources, received)) == 1
    assert not len(clocks(sources, received, alone=True))


def test_log_times_that_go_back_are_one_finding_of_all_topics(healthy, make_run, write_messages):
    run = make_run(healthy)
    back = [
        replace(m, log_time=m.log_time - (20 * MS if m.sequence > 200 else 0))
        for m in write_messages.read(run)
    ]
    text = 'order: the log times go back once, by 0.015 s or more, on '
    assert findings_of(write_messages(run, back)) == [
        f'{text}/crank_angle, /joint_states, /point_h'
    ]


def test_two_interleaved_publishers_give_no_finding(healthy, make_run, write_messages) -> None:
    run = make_run(healthy)
    messages = []
    for message in write_messages.read(run):
        messages.append(replace(message, log_time=message.log_time + 5 * MS))
        if message.topic.name == '/crank_angle':
            times = {'publish_time': message.publish_time + MS}
            messages.append(replace(message, log_time=message.log_time + 2 * MS, **times))
    messages.sort(key=lambda message: (message.publish_time, message.log_time))
    review = review_run(write_messages(run, messages))
    (topic,) = [topic for topic in review.recording.topics if topic.name == '/crank_angle']
    assert topic.reordered == 399 + 1
    assert 'order' not in checks(review)


def test_times_beyond_every_array_do_no_harm(healthy, make_run) -> None:
    time = healthy.answers[100].stamp
    largest = 2**64 - 1
    alpha = struct.pack('<4sd', b'\0\1\0\0', healthy.answers[100].alpha)
    other = replace(healthy.crank, name='/other')
    healthy.messages += [
        Message(healthy.crank, alpha, time + 200_000, largest, 0),
        Message(other, alpha, largest, 0, 0),
    ]
    (finding,) = findings_of(make_run(healthy))
    assert finding.startswith('order: 1 of 1202 log times is impossible (2554-07-21 23:34:33)')


@pytest.mark.parametrize('unheard', [0, None], ids=['one publisher', 'several'])
def test_the_recorder_stores_the_publisher_count(
    healthy, make_run, write_messages, unheard: int | None
) -> None:
    healthy.add_counts({'/other': TopicCount(3, 3, missed=unheard)})
    run = make_run(healthy)
    topic = Topic('/other', 'std_msgs/msg/String', 'string data')
    # The second one's only message is heard between two of the first, whose numbers are as low.
    messages = write_messages.read(run)
    for delay, number in ((500, 1), (540, 2), (507, 1)):
        time = healthy.answers[0].stamp + delay * MS
        messages.append(Message(topic, b'', time, time - 1000, number))
    review = review_run(write_messages(run, messages))
    assert checks(review) == ([] if unheard is None else ['order'])
