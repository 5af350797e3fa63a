"""Whatever stands in a log, a review of it ends with a report: nothing in it is believed."""

from contextlib import redirect_stdout
from io import StringIO
import json
import math
from pathlib import Path
import struct
import tempfile
import warnings

from hypothesis import given, settings, strategies as st
from klann_ros.kinematics import KlannGeometry
from klann_ros.log.definitions import definition
from klann_ros.log.run_parameters import LOSS_RECORD, PAUSE_RECORD, SOLVER_RECORD
from klann_ros.review.command import main
from leg_runs import STORE
from mcap.writer import Writer
import numpy as np

CRANK, STATE, POINT = (
    'std_msgs/msg/Float64',
    'sensor_msgs/msg/JointState',
    'geometry_msgs/msg/PointStamped',
)
PARAMETERS = (
    *('legs', 'direction', 'phase', 'crank_joint', 'l_ab', 'assembly', 'use_sim_time'),
    *('linkage_description', 'a.l_gh', 'a.phase'),
)
JOINTS = ['alpha', 'gamma', 'beta', 'delta', 'theta']
TOPICS = [('/crank_angle', CRANK), ('/joint_states', STATE), ('/point_h', POINT)]

# The usual, the edges, and values of no clock.
times = st.one_of(
    st.integers(1_700_000_000_000_000_000, 1_700_000_000_000_000_030),
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


def header(stamp):
    time = STORE.types['builtin_interfaces/msg/Time'](*stamp)
    return STORE.types['std_msgs/msg/Header'](time, 'frame')


@st.composite
def messages(draw):
    """Draw a topic's number, the bytes of a message, its times and its sequence number."""
    number = draw(st.integers(0, 2))
    stamp = draw(st.tuples(st.integers(-(2**31), 2**31 - 1), st.integers(0, 2**32 - 1)))
    if draw(st.booleans()):
        stamp = (1_700_000_000, draw(st.integers(0, 30)))
    if number == 0:
        data = struct.pack('<4sd', b'\0\1\0\0', draw(numbers))
    else:
        kind = TOPICS[number][1]
        if number == 1:
            arrays = [
                draw(st.lists(numbers, min_size=size, max_size=size))
                for size in (draw(st.just(5) | sizes), draw(sizes))
            ]
            as_array = STORE.types['sensor_msgs/msg/JointState']
            names = draw(st.sampled_from([JOINTS, JOINTS[::-1], ['crank'], [*JOINTS, 'alpha']]))
            content = as_array(header(stamp), names, *map(np.array, arrays), np.array([]))
        else:
            xyz = STORE.types['geometry_msgs/msg/Point'](*[draw(numbers) for _ in range(3)])
            content = STORE.types[kind](header(stamp), xyz)
        data = bytes(STORE.serialize_cdr(content, kind))
    if draw(st.integers(0, 9)) == 0:
        data = draw(st.binary(max_size=60))
    sequence = draw(st.one_of(st.integers(0, 30), st.integers(0, 2**32 - 1)))
    return number, data, draw(times), draw(times), sequence


def write(path: Path, contents, metadata) -> None:
    with path.open('wb') as file:
        writer = Writer(file, chunk_size=300)
        writer.start('ros2')
        channels = []
        for name, kind in TOPICS:
            schema = writer.register_schema(kind, 'ros2msg', definition(kind).encode())
            channels.append(writer.register_channel(name, 'cdr', schema))
        for number, data, log_time, publish_time, sequence in contents:
            writer.add_message(channels[number], log_time, data, publish_time, sequence)
        for name, record in metadata:
            writer.add_metadata(name, record)
        writer.finish()


@settings(max_examples=15)
@given(st.lists(messages(), max_size=25), records)
def test_a_review_ends_with_a_report(contents, metadata) -> None:
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        # What overflows or is no number is meant to be seen, not to be warned of.
        warnings.simplefilter('error')
        path = Path(folder, 'log.mcap')
        write(path, contents, metadata)
        out = [f'--csv={folder}/run.csv', f'--json={folder}/run.json']
        with redirect_stdout(StringIO()) as output:
            assert main([str(path), str(path), *out]) in (0, 1)
        assert output.getvalue().count('log.mcap') == 2
        report = json.loads(Path(folder, 'run.json').read_text())
        poses = sum(leg['poses'] for leg in report['legs'])
        assert len(Path(folder, 'run.csv').read_text().splitlines()) == 1 + poses
        assert report['comparison']['differences'] == []
