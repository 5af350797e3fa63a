"""Every leg that is shipped gives a healthy run: presets, walkers and linkages."""

from pathlib import Path
import struct

from findings import checks
from klann_ros.kinematics import KlannGeometry, KlannLeg, linkage_from_text, LinkageLeg
from klann_ros.kinematics.klann import NUMBERS
from klann_ros.log.records import Message
from klann_ros.log.run_parameters import (
    LINKAGE_PARAMETER,
    SOLVER_RECORD,
    solver_record,
    SolverParameters,
)
from klann_ros.log.write.writer import RunWriter
from klann_ros.nodes.solver.cdr import JointStateTemplate, PointTemplate
from klann_ros.review.reviewing import review_run
from leg_runs import START, topic_of
import numpy as np
import pytest
import yaml

ROOT = Path(__file__).resolve().parents[3]
# These two are of no leg.
OTHERS = {'motor_example.yaml', 'ros2_control.yaml'}
CONFIGS = [p for p in sorted((ROOT / 'config').glob('*.yaml')) if p.name not in OTHERS]
LINKAGES = sorted((ROOT / 'klann_ros' / 'linkages').glob('*.yaml'))
PERIOD = 10_000_000


def flat(parameters: dict) -> dict:
    """Return nested parameters under the names that a node gives them."""
    found = {}
    for name, value in parameters.items():
        inner = flat(value) if isinstance(value, dict) else {'': value}
        found.update({f'{name}.{key}'.rstrip('.'): each for key, each in inner.items()})
    return found


def parameters_of(path: Path) -> dict:
    if path.parent.name == 'linkages':
        return {LINKAGE_PARAMETER: path.read_text()}
    (content,) = yaml.safe_load(path.read_text()).values()
    geometry = KlannGeometry().as_dict()
    return {**geometry, **flat(content['ros__parameters'])}


_DRIVE = (('direction', 1), ('phase', 0.0))


def legs_of(parameters: dict) -> dict:
    """Return each leg with its direction and phase."""
    if LINKAGE_PARAMETER in parameters:
        return {'': (LinkageLeg(linkage_from_text(parameters[LINKAGE_PARAMETER], 'file')), 1, 0.0)}
    names = (*NUMBERS, 'assembly')
    leg = KlannLeg(KlannGeometry(**{name: parameters[name] for name in names}))
    return {
        name: (
            leg,
            *(parameters.get(f'{name}.{key}'.strip('.'), default) for key, default in _DRIVE),
        )
        for name in parameters.get('legs', [''])
    }


def crank_angles(parameters: dict, count: int) -> list[float]:
    """Return more than two turns, or most of its arc where a crank does not turn fully."""
    leg, *_ = next(iter(legs_of(parameters).values()))
    (start, end), *_ = leg.reachable_arcs()
    if end - start == 2 * np.pi:
        return np.linspace(-1.0, 14.0, count).tolist()
    margin = 0.05 * (end - start)
    return np.linspace(start + margin, end - margin, count).tolist()


def write(
    folder: Path,
    namespace: str,
    parameters: dict,
    *,
    recorded: dict | None = None,
    count: int = 120,
) -> Path:
    """Write a run of a solver with such parameters, as solver_node publishes."""
    legs = legs_of(parameters)
    prefixes = {name: f'{name}/' if name else '' for name in legs}
    joints = [p + j for name, p in prefixes.items() for j in legs[name][0].joint_names]
    crank = topic_of(f'{namespace}/crank_angle', 'std_msgs/msg/Float64')
    poses = topic_of(f'{namespace}/joint_states', 'sensor_msgs/msg/JointState')
    feet = {
        name: topic_of(f'{namespace}/{prefix}point_h', 'geometry_msgs/msg/PointStamped')
        for name, prefix in prefixes.items()
    }
    state, point = JointStateTemplate(joints), PointTemplate('leg_plane')
    with RunWriter(folder) as run:
        solver = SolverParameters(f'{namespace}/solver_node', START, recorded or parameters)
        run.add_metadata(SOLVER_RECORD, solver_record(solver))
        for n, alpha in enumerate(crank_angles(parameters, count)):
            stamp = START + n * PERIOD
            times, solved = divmod(stamp, 10**9), {}
            for name, (leg, direction, phase) in legs.items():
                solved[name] = leg.solve(direction * alpha + phase)
            angles = tuple(x for pose in solved.values() for x in (pose.alpha, *pose.x))
            contents = [
                (crank, struct.pack('<4sd', b'\0\1\0\0', alpha)),
                (poses, state.fill(*times, angles, ())),
                *((feet[name], point.fill(*times, *pose.h)) for name, pose in solved.items()),
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
def test_what_is_shipped_gives_a_healthy_run(tmp_path, path, namespace) -> None:
    parameters = parameters_of(path)
    review = review_run(write(tmp_path / 'run', namespace, parameters))
    assert checks(review) == []
    legs = parameters.get('legs', [''])
    titles = {'/'.join(part for part in (namespace[1:], leg) if part) for leg in legs}
    assert {leg.recording.title for leg in review.legs} == titles
    for leg in review.legs:
        assert leg.errors is not None
        assert (
            len(leg.evaluated.poses) == len(leg.evaluated.feet) == len(leg.evaluated.cranks) == 120
        )
        assert leg.figures.worst_foot_error < 1e-12
        first, *_, last = crank_angles(parameters, 120)
        assert abs(leg.figures.turns) == pytest.approx((last - first) / (2 * np.pi))


@pytest.mark.parametrize('change', [{'rear_left.direction': 1}, {'front_right.phase': 3.1}])
def test_a_leg_of_a_walker_that_is_driven_otherwise_is_found(tmp_path, change) -> None:
    parameters = parameters_of(ROOT / 'config' / 'walker4.yaml')
    # The poses are those of one walker, the record is that of another.
    run = write(tmp_path / 'run', '', {**parameters, **change}, recorded=parameters, count=50)
    (finding,) = review_run(run).findings
    assert (finding.check, finding.leg) == ('alpha', next(iter(change)).partition('.')[0])
