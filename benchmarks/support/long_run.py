"""A long run of a linkage that turns once a second, as the nodes would make it, but at once."""

from math import pi
from pathlib import Path
import struct

from klann_ros.kinematics import KlannGeometry, Linkage, linkage_from_text, linkage_poses
from klann_ros.log.definitions import definition
from klann_ros.log.records import Message, Topic
from klann_ros.log.run_parameters import (
    LINKAGE_PARAMETER,
    SOLVER_RECORD,
    solver_record,
    SolverParameters,
)
from klann_ros.log.write.writer import RunWriter
from klann_ros.messages import JointStateTemplate, point_template
import numpy as np

START = 1_700_000_000_000_000_000
# Poses that are solved at once.
_BLOCK = 10_000


def _topic(name: str, kind: str) -> Topic:
    return Topic(name, kind, definition(kind))


CRANK = _topic('/crank_angle', 'std_msgs/msg/Float64')
POSES = _topic('/joint_states', 'sensor_msgs/msg/JointState')
FEET = _topic('/point_h', 'geometry_msgs/msg/PointStamped')


def write_long_run(
    folder: Path, seconds: float, rate: float, text: str = '', compression: str = 'zstd'
) -> None:
    """
    Write a run of a duration and a crank message rate.

    `text` is a linkage's file; where left out it is a run of the Klann leg.
    """
    count = round(seconds * rate)
    linkage = linkage_from_text(text, 'the benchmark') if text else KlannGeometry().linkage
    parameters = {LINKAGE_PARAMETER: text} if text else KlannGeometry().as_dict()
    record = solver_record(SolverParameters('/solver_node', START, parameters))
    with RunWriter(folder, compression=compression) as run:
        run.add_metadata(SOLVER_RECORD, record)
        for begin in range(0, count, _BLOCK):
            _write_block(run, linkage, np.arange(begin, min(begin + _BLOCK, count)), rate)


def _write_block(run: RunWriter, linkage: Linkage, numbers: np.ndarray, rate: float) -> None:
    joints = JointStateTemplate([*linkage.joint_names])
    point = point_template('leg_plane')
    alphas = 2 * pi * numbers / rate
    poses = linkage_poses(linkage, alphas, angles=True)
    assert poses.angles is not None  # noqa: S101 - asked for
    angles = np.column_stack([alphas, poses.angles])
    rates = np.gradient(angles, 1 / rate, axis=0) if len(numbers) > 1 else np.zeros_like(angles)
    delays = np.random.default_rng(int(numbers[0])).integers(200_000, 500_000, len(numbers))
    stamps = START + (numbers * (1e9 / rate)).astype(np.int64)
    columns = (column.tolist() for column in (numbers, stamps, delays, angles, rates, poses.h))
    for n, stamp, delay, x, v, h in zip(*columns, strict=True):
        log_time = stamp + delay
        sec, nanosec = divmod(stamp, 10**9)
        crank = struct.pack('<4sd', b'\0\1\0\0', x[0])
        run.write(Message(CRANK, crank, log_time, stamp, n + 1))
        pose = joints.fill(sec, nanosec, tuple(x), tuple(v))
        run.write(Message(POSES, pose, log_time + 100_000, stamp + 50_000, n + 1))
        foot = point.fill(sec, nanosec, *h)
        run.write(Message(FEET, foot, log_time + 150_000, stamp + 60_000, n + 1))
