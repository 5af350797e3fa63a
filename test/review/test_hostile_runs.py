"""Whatever stands in a log, a review of it ends with a report: nothing in it is believed."""

from contextlib import redirect_stdout
from io import StringIO
import json
import math
from pathlib import Path
import struct
import tempfile
import warnings

from crank_runs import write_mcap
from hypothesis import example, given, settings, strategies as st
from klann_ros.kinematics import KlannGeometry
from klann_ros.log.records import Message
from klann_ros.log.run_parameters import (
    LOSS_RECORD,
    PAUSE_RECORD,
    SOLVER_RECORD,
    solver_record,
    SolverParameters,
)
from klann_ros.review.command import main
from leg_runs import foot_at, joint_state, make, POINT, START, STATE, STORE, topic_of

TOPICS = [
    topic_of('/crank_angle', 'std_msgs/msg/Float64'),
    topic_of('/joint_states', STATE),
    topic_of('/point_h', POINT),
]
PARAMETERS = (
    *('legs', 'direction', 'phase', 'crank_joint', 'l_ab', 'assembly', 'use_sim_time'),
    *('linkage_description', 'a.l_gh', 'a.phase'),
)
JOINTS = ['alpha', 'gamma', 'beta', 'delta', 'theta']

# The usual, the edges, and values of no clock.
times = st.one_of(
    st.integers(START, START + 30),
    st.sampled_from([0, 1, 2**62, 2**63 - 1, 2**63, 2**64 - 1]),
    st.integers(0, 2**64 - 1),
)
odd_numbers = st.sampled_from([math.inf, math.nan, 1e308])
numbers = st.one_of(st.floats(-4.0, 4.0), st.floats(), odd_numbers)
sizes = st.sampled_from([0, 1, 4, 5, 6])
anything = st.recursive(
    st.one_of(
        st.none(), st.booleans(), st.integers(), st.just(10**400), st.floats(), st.text(max_size=5)
    ),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner),
    max_leaves=5,
)
parameters = st.builds(
    lambda base, odd: {**base, **odd},
    st.sampled_from([{}, KlannGeometry().as_dict()]),
    st.dictionaries(
        st.sampled_from(PARAMETERS),
        anything,
        max_size=3,
    ),
)
records = st.lists(
    st.one_of(
        st.tuples(
            st.just(SOLVER_RECORD),
            st.fixed_dictionaries(
                {
                    'node': st.sampled_from(['/solver_node', '/a/solver_node', '', 'x']),
                    'time': st.one_of(times.map(str), st.integers().map(str), st.text(max_size=3)),
                    'parameters': parameters.map(json.dumps),
                }
            ),
        ),
        st.tuples(
            st.sampled_from([SOLVER_RECORD, LOSS_RECORD, PAUSE_RECORD]),
            st.dictionaries(
                st.sampled_from(['node', 'from', 'to', '/joint_states', '/point_h']),
                st.one_of(st.integers().map(str), st.text(max_size=4)),
            ),
        ),
    ),
    max_size=3,
)


@st.composite
def messages(draw):
    """Draw a message of any numbers and times, now and then of any bytes."""
    stamp = draw(st.tuples(st.integers(-(2**31), 2**31 - 1), st.integers(0, 2**32 - 1)))
    if draw(st.booleans()):
        stamp = START // 10**9, draw(st.integers(0, 30))
    topic = draw(st.sampled_from(TOPICS))
    if topic.type == STATE:
        arrays = [
            draw(st.lists(numbers, min_size=size, max_size=size))
            for size in (draw(st.just(5) | sizes), draw(sizes))
        ]
        names = draw(st.sampled_from([JOINTS, JOINTS[::-1], ['crank'], [*JOINTS, 'alpha']]))
        content = joint_state(0, names, *arrays)
    elif topic.type == POINT:
        content = foot_at(0, (draw(numbers), draw(numbers)))
    else:
        content = make(topic.type, data=draw(numbers))
    data = bytes(STORE.serialize_cdr(content, topic.type))
    if topic.type in (STATE, POINT):
        data = data[:4] + struct.pack('<iI', *stamp) + data[12:]
    if draw(st.integers(0, 9)) == 0:
        data = draw(st.binary(max_size=60))
    sequence = draw(st.one_of(st.integers(0, 30), st.integers(0, 2**32 - 1)))
    return Message(topic, data, draw(times), draw(times), sequence)


SEVEN_RADIANS = Message(
    TOPICS[1],
    bytes(STORE.serialize_cdr(joint_state(START, JOINTS, [7.0, 0.0, 0.0, 0.0, 0.0]), STATE)),
    *(START, START, 0),
)
SOLVER = SolverParameters('/solver_node', START, KlannGeometry().as_dict())


@settings(max_examples=15)
@example([SEVEN_RADIANS], [(SOLVER_RECORD, solver_record(SOLVER))])
@given(st.lists(messages(), max_size=25), records)
def test_a_review_ends_with_a_report(contents, metadata) -> None:
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        # What overflows or is no number is meant to be seen, not to be warned of.
        warnings.simplefilter('error')
        path = Path(folder, 'log.mcap')
        write_mcap(path, [contents], metadata=metadata, chunk_size=300)
        out = [f'--csv={folder}/run.csv', f'--json={folder}/run.json']
        with redirect_stdout(StringIO()) as output:
            assert main([str(path), str(path), *out]) in (0, 1)
        assert output.getvalue().count('log.mcap') == 2
        report = json.loads(Path(folder, 'run.json').read_text())
        poses = sum(leg['poses'] for leg in report['legs'])
        assert len(Path(folder, 'run.csv').read_text().splitlines()) == 1 + poses
        assert report['comparison']['differences'] == []
