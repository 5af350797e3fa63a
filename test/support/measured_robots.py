"""Robots built with errors, and what cameras measure of them; runs of it as MCAP files."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
import math
from pathlib import Path
from typing import Any

from klann_ros.calibration import CrankSamples, kind_of, MeasuredSeries, series_of
from klann_ros.kinematics import KlannGeometry, Linkage, linkage_poses
from klann_ros.log.records import Message, Topic
from klann_ros.log.run_parameters import SOLVER_RECORD, solver_record, SolverParameters
from klann_ros.log.write.writer import RunWriter
from leg_runs import filled, FLOAT, joint_state, POINT, stamp_fields, START, STATE, STORE
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


@lru_cache(maxsize=4)
def encoder_samples(times: tuple[float, ...], positions: tuple[float, ...]) -> CrankSamples:
    """Return the samples of an encoder: the same object for all series of a robot."""
    return CrankSamples.of(np.array(times), np.array(positions))


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
        positions = self.crank if crank is None else crank
        encoder = encoder_samples(tuple(self.times.tolist()), tuple(positions.tolist()))
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
    truth = np.array([*robot.linkage.numbers, robot.phase])
    deviations = calibration.values[: len(truth)] - truth
    deviations[-1] = math.remainder(deviations[-1], math.tau)
    return np.array(deviations / calibration.standard_errors[: len(truth)])


# Runs.


def message(kind: str, time: int, place: Any) -> Any:
    """Return a message of one of the types of measured points, or of a crank."""
    if kind == STATE:
        return joint_state(time, [*place], [*place.values()])
    if kind == FLOAT:
        return filled(kind, {'data': float(place)})
    position = dict(zip('xy', map(float, place), strict=True))
    rotation = {'w': 1.0}
    pose = {'position': position, 'orientation': rotation}
    covariance = [NOISE**2 * (k in {0, 7}) for k in range(36)]
    header = {'header': {'stamp': stamp_fields(time), 'frame_id': 'camera'}}
    marker_transform = {'translation': position, 'rotation': rotation}
    marker = {'transform': marker_transform, 'child_frame_id': 'marker'}
    other_frame = {'transform': {'translation': {'x': 9.0}}, 'child_frame_id': 'other'}
    contents = {
        'PointStamped': {'point': position},
        'PoseStamped': {'pose': pose},
        'PoseWithCovarianceStamped': {'pose': {'pose': pose, 'covariance': covariance}},
        'TransformStamped': marker,
        'TFMessage': {'transforms': [header | other_frame, header | marker]},
        'Marker': {'ns': 'marker', 'id': 7, 'pose': pose},
    }
    return filled(kind, header | contents[kind.rpartition('/')[2]])


def write_run(
    folder: Path,
    topics: Mapping[str, tuple[str, Sequence[tuple[float, Any]]]],
    parameters: Mapping[str, Any] | None = None,
) -> Path:
    """Write a run: of each topic its type, and its stamps [s] with their content."""
    samples = []
    for name, (kind, content) in topics.items():
        samples += [(round(time * 1e9) + START, name, kind, place) for time, place in content]
    samples.sort(key=lambda sample: sample[0])
    with RunWriter(folder) as run:
        if parameters is not None:
            solver = SolverParameters('/solver_node', START, dict(parameters))
            run.add_metadata(SOLVER_RECORD, solver_record(solver))
        numbers = Counter[str]()
        for time, name, kind, place in samples:
            numbers[name] += 1
            data = bytes(STORE.serialize_cdr(message(kind, time, place), kind))
            # tf2_msgs need not be installed.
            topic = Topic(name, kind, STORE.generate_msgdef(kind, ros_version=2)[0])
            run.write(Message(topic, data, time + 10**6, time, numbers[name]))
    return folder


def crank_topic(robot: Robot) -> tuple[str, Sequence[tuple[float, Any]]]:
    states = [{'crank': float(angle)} for angle in robot.crank]
    return STATE, [*zip(robot.times.tolist(), states, strict=True)]


def points_topic(
    robot: Robot, name: str, kind: str = POINT
) -> tuple[str, Sequence[tuple[float, Any]]]:
    return kind, [*zip(robot.times.tolist(), robot.seen(name).tolist(), strict=True)]
