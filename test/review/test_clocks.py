"""Times that do not fit together: clocks, latency and order, each found once."""

from dataclasses import replace

from findings import moments
from klann_ros.review.reviewing import review_run

MS = 1_000_000


def test_a_publishers_clock_that_is_off_is_found_once(healthy, make_run, without) -> None:
    for n in range(400):
        stamp = healthy.answers[n].stamp
        healthy.change(n, header_stamp=stamp - 3_000 * MS)
    run = without(make_run(healthy), late=3_000 * MS)
    review = review_run(run)
    assert moments(review) == [('clock', None)]
    assert review.findings[0].text.startswith("the publisher's clock is 3.000 s behind")


def test_stamps_of_another_clock_are_found(healthy, make_run) -> None:
    healthy.by_crank_state()
    for n in range(400):
        healthy.change(n, header_stamp=healthy.answers[n].stamp + 700 * MS)
    review = review_run(make_run(healthy))
    assert moments(review) == [('clock', None)]
    ahead = "the stamps of the poses are 0.700 s ahead of the log's clock"
    assert review.findings[0].text == ahead


def test_late_messages_are_found_on_their_topic(healthy, make_run, without) -> None:
    late = {20, 21, 22, 23, 24}
    run = without(
        make_run(healthy),
        late=lambda m: 150 * MS if m.topic.name == '/point_h' and m.sequence in late else 0,
    )
    review = review_run(run)
    assert moments(review) == [('latency', 0.245)]
    said = 'one in a hundred messages of /point_h came 0.150 s late'
    assert review.findings[0].text == said


def test_a_recorders_clock_that_is_set_back_is_found(healthy, make_run, write_messages) -> None:
    run = make_run(healthy)
    back = [
        replace(m, log_time=m.log_time - (20 * MS if m.sequence > 200 else 0))
        for m in write_messages.read(run)
        if m.topic.name != '/point_h'
    ]
    review = review_run(write_messages(run, back))
    assert moments(review) == [('order', 0.98)]
    said = '1 messages of /crank_angle, /joint_states are logged before those they follow'
    assert review.findings[0].text == said


def test_stamps_that_go_back_are_found(healthy, make_run) -> None:
    healthy.by_crank_state()
    first, second = healthy.answers[100].stamp, healthy.answers[101].stamp
    healthy.change(100, header_stamp=second)
    healthy.change(101, header_stamp=first)
    review = review_run(make_run(healthy))
    assert moments(review) == [('order', 0.505)]
