"""Robots built with errors, and what cameras measure of them; runs of it as MCAP files."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
import math
from pathlib import Path
from typing import Any

from klann_ros.calibration import CrankSamples, kind_of, MeasuredSeries, series_of
from klann_ros.kinematics import KlannGeometry, Linkage, linkage_poses
from klann_ros.log.records import Message, Topic
from klann_ros.log.run_parameters import SOLVER_RECORD, solver_record, SolverParameters
from klann_ros.log.write.writer import RunWriter
from leg_runs import START, STORE
import numpy as np

DRAWN = KlannGeometry.sem104().linkage
NOISE = 1e-4


def built(
    seed: int, drawn: Linkage = DRAWN, *, length: float = 5e-4, bend: float = 1.0
) -> Linkage:
    """Return a leg with errors of every dimension [m, deg]."""
    rng = np.random.default_rng(seed)
    scale = [length if d.unit == 'm' else math.radians(bend) for d in drawn.structure.dimensions]
    numbers = np.array(drawn.numbers) + rng.normal(0.0, scale)
    return drawn.varied(dict(zip(drawn.dimensions, numbers.tolist(), strict=True)))


@dataclass(frozen=True)
class Robot:
    """A robot as it was built, its turning crank, and how it is measured."""

    linkage: Linkage = field(default_factory=lambda: built(1))
    # The zero of the encoder [rad], the crank's speed [rad/s], and how often it is measured [s].
    phase: float = 0.02
    speed: float = 1.3
    count: int = 1000
    period: float = 0.005
    seed: int = 2
    noise: float = NOISE
    outliers: float = 0.0

    @property
    def times(self) -> np.ndarray:
        return self.period * np.arange(self.count)

    @property
    def crank(self) -> np.ndarray:
        return self.speed * self.times

    def place(self, name: str) -> np.ndarray:
        """Return a point of the turning leg, shape (n, 2) [m]."""
        structure = self.linkage.structure
        poses = linkage_poses(self.linkage, self.crank + self.phase, points=True)
        return np.array(poses.points[:, structure.points.index(name)])

    def seen(self, name: str) -> np.ndarray:
        """Return it as a camera measures it."""
        rng = np.random.default_rng([self.seed, *name.encode()])
        wrong = rng.random(self.count) < self.outliers
        noise = rng.normal(0.0, self.noise, (self.count, 2))
        return self.place(name) + noise + wrong[:, None] * rng.normal(0.0, 0.05, (self.count, 2))

    def angle(self, name: str, noise: float = math.radians(0.05)) -> np.ndarray:
        j = self.linkage.joint_names.index(name) - 1
        poses = linkage_poses(self.linkage, self.crank + self.phase, angles=True)
        rng = np.random.default_rng([self.seed, j])
        return np.array(poses.angles[:, [j]]) + rng.normal(0.0, noise, (self.count, 1))

    def series(
        self,
        name: str,
        values: np.ndarray | None = None,
        *,
        crank: np.ndarray | None = None,
        noise: float | None = None,
    ) -> MeasuredSeries:
        """Return a point or an angle as measured, with other values or crank angles."""
        kind = kind_of(self.linkage, name)
        if values is None:
            values = self.seen(name) if kind == 'point' else self.angle(name)
        encoder = CrankSamples.of(self.times, self.crank if crank is None else crank)
        return series_of(kind, name, self.times[: len(values)], values, encoder, noise=noise)

    def measured(self, names: Sequence[str] = 'HG') -> list[MeasuredSeries]:
        return [self.series(name, noise=self.noise) for name in names]

    def moved(self, crank: np.ndarray, names: Sequence[str] = 'HG') -> list[np.ndarray]:
        """Return points as measured where the crank has turned otherwise."""
        poses = linkage_poses(self.linkage, crank + self.phase, points=True)
        rng = np.random.default_rng(6)
        places = [self.linkage.structure.points.index(name) for name in names]
        noises = rng.normal(0.0, self.noise, (len(places), self.count, 2))
        return [*(np.moveaxis(poses.points[:, places], 1, 0) + noises)]


def errors(calibration: Any, robot: Robot) -> np.ndarray:
    """Return the errors of dimensions and phase over their standard errors."""
    true = np.array([*robot.linkage.numbers, robot.phase])
    found = calibration.values[: len(true)] - true
    found[-1] = math.remainder(found[-1], math.tau)
    return np.array(found / calibration.standard_errors[: len(true)])


# Runs.


def make(kind: str, **fields: Any) -> Any:
    return STORE.types[kind](**fields)


def stamp(time: int) -> Any:
    return make('builtin_interfaces/msg/Time', sec=time // 10**9, nanosec=time % 10**9)


def header(time: int, frame: str = 'camera') -> Any:
    return make('std_msgs/msg/Header', stamp=stamp(time), frame_id=frame)


def vector(kind: str, place: Sequence[float]) -> Any:
    x, y = map(float, place)
    return make(f'geometry_msgs/msg/{kind}', x=x, y=y, z=0.3)


def pose(place: Sequence[float]) -> Any:
    orientation = make('geometry_msgs/msg/Quaternion', x=0.0, y=0.0, z=0.0, w=1.0)
    position = vector('Point', place)
    return make('geometry_msgs/msg/Pose', position=position, orientation=orientation)


def transform(time: int, place: Sequence[float], child: str) -> Any:
    rotation = pose(place).orientation
    moved = make(
        'geometry_msgs/msg/Transform', translation=vector('Vector3', place), rotation=rotation
    )
    return make(
        'geometry_msgs/msg/TransformStamped',
        header=header(time),
        child_frame_id=child,
        transform=moved,
    )


def message(  # noqa: PLR0911 - a type each
    kind: str, time: int, place: Any, name: str = 'marker'
) -> Any:
    """Return a message of one of the types of measured points, or of a crank."""
    if kind == 'geometry_msgs/msg/PointStamped':
        return make(kind, header=header(time), point=vector('Point', place))
    if kind == 'geometry_msgs/msg/PoseStamped':
        return make(kind, header=header(time), pose=pose(place))
    if kind == 'geometry_msgs/msg/PoseWithCovarianceStamped':
        covariance = np.zeros(36)
        covariance[[0, 7]] = NOISE**2
        whole = make(
            'geometry_msgs/msg/PoseWithCovariance', pose=pose(place), covariance=covariance
        )
        return make(kind, header=header(time), pose=whole)
    if kind == 'geometry_msgs/msg/TransformStamped':
        return transform(time, place, name)
    if kind == 'tf2_msgs/msg/TFMessage':
        return make(
            kind, transforms=[transform(time, (9.0, 9.0), 'other'), transform(time, place, name)]
        )
    if kind == 'visualization_msgs/msg/Marker':
        colour = make('std_msgs/msg/ColorRGBA', r=1.0, g=0.0, b=0.0, a=1.0)
        never = make('builtin_interfaces/msg/Duration', sec=0, nanosec=0)
        image = make(
            'sensor_msgs/msg/CompressedImage',
            header=header(0),
            format='',
            data=np.empty(0, np.uint8),
        )
        mesh = make('visualization_msgs/msg/MeshFile', filename='', data=np.empty(0, np.uint8))
        return make(
            kind, header=header(time), ns=name, id=7, type=2, action=0, pose=pose(place),
            scale=vector('Vector3', (0.1, 0.1)), color=colour, lifetime=never, frame_locked=False,
            points=[], colors=[], texture_resource='', texture=image, uv_coordinates=[], text='',
            mesh_resource='', mesh_file=mesh, mesh_use_embedded_materials=False,
        )  # fmt: skip
    if kind == 'sensor_msgs/msg/JointState':
        names, values = zip(*place.items(), strict=True)
        return make(
            kind,
            header=header(time),
            name=[*names],
            position=np.array(values),
            velocity=np.empty(0),
            effort=np.empty(0),
        )
    return make(kind, data=float(place))


def write_run(
    folder: Path,
    topics: Mapping[str, tuple[str, Sequence[tuple[float, Any]]]],
    parameters: Mapping[str, Any] | None = None,
) -> Path:
    """Write a run: of each topic its type, and its stamps [s] with their content."""
    rows = [
        (round(time * 1e9) + START, name, kind, place)
        for name, (kind, content) in topics.items()
        for time, place in content
    ]
    with RunWriter(folder) as run:
        if parameters is not None:
            solver = SolverParameters('/solver_node', START, dict(parameters))
            run.add_metadata(SOLVER_RECORD, solver_record(solver))
        for number, (time, name, kind, place) in enumerate(sorted(rows, key=lambda row: row[0])):
            data = bytes(STORE.serialize_cdr(message(kind, time, place), kind))
            # tf2_msgs need not be installed.
            topic = Topic(name, kind, STORE.generate_msgdef(kind, ros_version=2)[0])
            run.write(Message(topic, data, time + 10**6, time, number))
    return folder


def crank_topic(robot: Robot) -> tuple[str, Sequence[tuple[float, Any]]]:
    states = [{'crank': float(angle)} for angle in robot.crank]
    return 'sensor_msgs/msg/JointState', [*zip(robot.times.tolist(), states, strict=True)]


def points_topic(
    robot: Robot, name: str, kind: str = 'geometry_msgs/msg/PointStamped'
) -> tuple[str, Sequence[tuple[float, Any]]]:
    return kind, [*zip(robot.times.tolist(), robot.seen(name).tolist(), strict=True)]
