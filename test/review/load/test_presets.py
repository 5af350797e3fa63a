"""Every leg that is shipped gives a healthy run: presets, walkers and linkages."""

from pathlib import Path
import struct

from findings import checks
from klann_ros.kinematics import KlannGeometry, LinkageLeg
from klann_ros.log.records import Message
from klann_ros.log.run_parameters import (
    LINKAGE_PARAMETER,
    SOLVER_RECORD,
    solver_record,
    SolverParameters,
)
from klann_ros.log.write.writer import RunWriter
from klann_ros.review.reviewing import review_run
from klann_ros.robot import Robot, robot_of, RobotLeg
from klann_ros.sanitize.cdr import JointStateTemplate, PointTemplate
from leg_runs import START, topic_of
import numpy as np
import pytest
import yaml

ROOT = Path(__file__).resolve().parents[3]
# These are of no leg.
OTHERS = {'motor_example.yaml', 'ros2_control.yaml', 'ekf.yaml', 'nav2_walker.yaml'}
CONFIGS = [p for p in sorted((ROOT / 'config').glob('*.yaml')) if p.name not in OTHERS]
LINKAGES = sorted((ROOT / 'klann_ros' / 'linkages').glob('*.yaml'))
# Of the messages: more than a check needs, and steps below those of a jump.
PERIOD, COUNT = 10_000_000, 60


def flat(parameters: dict) -> dict:
    """Return nested parameters under the names that a node gives them."""
    found = {}
    for name, value in parameters.items():
        inner = flat(value) if isinstance(value, dict) else {'': value}
        found.update({f'{name}.{key}'.rstrip('.'): each for key, each in inner.items()})
    return found


def parameters_of(path: Path) -> dict:
    """Return the parameters as solver_node records them: with the text of a linkage."""
    if path.parent.name == 'linkages':
        return {LINKAGE_PARAMETER: path.read_text()}
    (content,) = yaml.safe_load(path.read_text()).values()
    given = flat(content['ros__parameters'])
    if 'linkage' in given:
        return given | {LINKAGE_PARAMETER: robot_of(str(path)).legs[0].description}
    return KlannGeometry().as_dict() | given


def crank_angles(leg: RobotLeg, count: int) -> list[float]:
    """Return more than two turns, or most of its arc where a crank does not turn fully."""
    (start, end), *_ = LinkageLeg(leg.linkage).reachable_arcs()
    if end - start == 2 * np.pi:
        return np.linspace(-1.0, 14.0, count).tolist()
    margin = 0.05 * (end - start)
    return np.linspace(start + margin, end - margin, count).tolist()


def write(folder: Path, namespace: str, robot: Robot, recorded: dict, count: int = COUNT) -> Path:
    """Write a run of a solver with such parameters, as solver_node publishes."""
    legs = [(leg, LinkageLeg(leg.linkage)) for leg in robot.legs]
    crank = topic_of(f'{namespace}/crank_angle', 'std_msgs/msg/Float64')
    poses = topic_of(f'{namespace}/joint_states', 'sensor_msgs/msg/JointState')
    feet = [
        topic_of(f'{namespace}/{leg.prefix}point_h', 'geometry_msgs/msg/PointStamped')
        for leg, _ in legs
    ]
    state, point = JointStateTemplate(robot.joint_names('/')), PointTemplate('leg_plane')
    with RunWriter(folder) as run:
        # The solver holds the text of the linkage's file.
        text = {LINKAGE_PARAMETER: robot.legs[0].description}
        solver = SolverParameters(f'{namespace}/solver_node', START, {**recorded, **text})
        run.add_metadata(SOLVER_RECORD, solver_record(solver))
        for n, alpha in enumerate(crank_angles(robot.legs[0], count)):
            stamp = START + n * PERIOD
            times = divmod(stamp, 10**9)
            solved = [one.solve(leg.direction * alpha + leg.phase) for leg, one in legs]
            angles = tuple(x for pose in solved for x in (pose.alpha, *pose.x))
            contents = [
                (crank, struct.pack('<4sd', b'\0\1\0\0', alpha)),
                (poses, state.fill(*times, angles, ())),
                *(
                    (foot, point.fill(*times, *pose.h))
                    for foot, pose in zip(feet, solved, strict=True)
                ),
            ]
            for each, data in contents:
                run.write(Message(each, bytes(data), stamp + 300_000, stamp, n + 1))
    return folder


@pytest.mark.parametrize(
    ('path', 'namespace'),
    [(path, '') for path in CONFIGS + LINKAGES]
    + [(ROOT / 'config' / 'walker4.yaml', '/robot/left')],
    ids=lambda value: getattr(value, 'stem', value),
)
def test_shipped_configurations_give_a_healthy_run(tmp_path, path, namespace) -> None:
    parameters, robot = parameters_of(path), robot_of(str(path))
    review = review_run(write(tmp_path / 'run', namespace, robot, parameters))
    assert checks(review) == []
    legs = parameters.get('legs', [''])
    titles = {'/'.join(part for part in (namespace[1:], leg) if part) for leg in legs}
    assert {leg.recording.title for leg in review.legs} == titles
    for leg in review.legs:
        assert leg.errors is not None
        assert (
            len(leg.evaluated.poses)
            == len(leg.evaluated.feet)
            == len(leg.evaluated.cranks)
            == COUNT
        )
        assert leg.figures.worst_foot_error < 1e-12
        first, *_, last = crank_angles(robot.legs[0], COUNT)
        assert abs(leg.figures.turns) == pytest.approx((last - first) / (2 * np.pi))


@pytest.mark.parametrize(
    ('name', 'change'), [('rear_left.direction', 1), ('front_right.phase', 3.1)]
)
def test_a_leg_of_a_walker_that_is_driven_otherwise_is_found(tmp_path, name, change) -> None:
    path = ROOT / 'config' / 'walker4.yaml'
    # The poses are those of one walker, the record is that of another.
    recorded = {**parameters_of(path), name: change}
    (finding,) = review_run(
        write(tmp_path / 'run', '', robot_of(str(path)), recorded, 50)
    ).findings
    assert (finding.check, finding.leg) == ('alpha', name.partition('.')[0])
