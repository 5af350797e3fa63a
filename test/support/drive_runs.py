"""Runs of cranks that are driven: by ros2_control's controllers, or by a walker's commands."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache
from math import nan, tau
from pathlib import Path
from typing import Any

from klann_ros.kinematics import KlannLeg, KlannPose
from klann_ros.log.records import Message
from klann_ros.log.run_parameters import SOLVER_RECORD, solver_record, SolverParameters
from klann_ros.log.write.writer import RunWriter
from leg_runs import filled, foot_at, joint_state, leg_header, POINT, START, STATE, STORE, topic_of
import numpy as np

ARRAY = 'std_msgs/msg/Float64MultiArray'
TRAJECTORY = 'trajectory_msgs/msg/JointTrajectory'
KEY_VALUE = 'diagnostic_msgs/msg/KeyValue'
CLOCK = 'rosgraph_msgs/msg/Clock'
JOINTS = ('left_crank', 'right_crank')
FEEDBACK = '/joint_state_broadcaster/joint_states'
VELOCITIES = '/crank_velocity_controller/commands'
PERIOD = 0.02
LEG = KlannLeg()
SOLVER = SolverParameters(
    '/solver_node',
    START,
    {
        'legs': ['left', 'right'],
        **{f'{side}.crank_joint': f'{side}_crank' for side in ('left', 'right')},
        **LEG.geometry.as_dict(),
    },
)
# Velocity of the cranks in the spans of a drive [s], [rad/s]; it stands in between.
DRIVE = ((1.0, 3.0, 2.0), (4.5, 6.0, -1.5))
DURATION = 7.0
# Delay of the cranks behind their commands [s].
DELAY = 0.03


@dataclass
class DriveRun:
    """A drive with standstill before, between and behind its spans, and what is wrong with it."""

    # Topics of the feedback, and of the commands with their type.
    feedback: Sequence[str] = (FEEDBACK,)
    commands: str = VELOCITIES
    command_type: str = ARRAY
    # Number of messages before the first feedback, which are NaN.
    unknown: int = 15
    # Whether a solver runs and answers, and whether commands are sent during standstill.
    solver: bool = True
    answers: bool = True
    idle: bool = True
    # Ratio of simulated time, with which all happens, to time; 0 for no /clock.
    sim_rate: float = 0.0
    # Spans [s] without feedback and commands, and in which the right crank is blocked, or NaN.
    silent: tuple[float, float] = (0.0, 0.0)
    uncommanded: tuple[float, float] = (0.0, 0.0)
    blocked: tuple[float, float] = (0.0, 0.0)
    invalid: tuple[float, float] = (0.0, 0.0)
    # Whether the encoders begin again at each turn, within the one below 0.
    wrapped: bool = False
    # Ratio of the length of the shank to that of the solver's leg.
    scale: float = 1.0
    # Whether a last command to stand is missing.
    cut: bool = False
    _numbers: dict[str, int] = field(default_factory=dict)

    def write(self, folder: Path) -> Path:
        with RunWriter(folder) as run:
            if self.solver:
                run.add_metadata(SOLVER_RECORD, solver_record(SOLVER))
            for message in self.received():
                run.write(message)
        return folder

    def received(self) -> list[Message]:
        """Return the messages as they are received."""
        return sorted(self._messages(), key=lambda message: message.log_time)

    def _messages(self) -> Iterator[Message]:
        times = np.arange(0.0, DURATION, PERIOD)
        commanded = np.array([velocity(time) for time in times])
        cranks = np.array([self._cranks(time) for time in times])
        for n, time in enumerate(times.tolist()):
            if self.sim_rate:
                stamp = self._stamp(time)
                clock = {'clock': {'sec': stamp // 10**9, 'nanosec': stamp % 10**9}}
                yield self._message('/clock', CLOCK, time, clock)
            if not _is_in(time, self.silent):
                yield from self._feedback(n, time, cranks[n], commanded[n])
            recent = slice(max(0, n - 2), n + 1)
            is_idle = not self.idle and not commanded[recent].any()
            if not (is_idle or _is_in(time, self.uncommanded)):
                yield from self._commands(n, time, commanded[n])

    def _cranks(self, time: float) -> tuple[float, float]:
        """Return the angles of the cranks [rad]."""
        left = angle(time - DELAY)
        blocked_begin, blocked_end = self.blocked
        right = left
        if blocked_begin < time:
            held = min(time, blocked_end) - DELAY
            right -= angle(held) - angle(blocked_begin - DELAY)
        return left, right + np.pi

    def _feedback(self, n: int, time: float, cranks: Any, rate: float) -> Iterator[Message]:
        angles = [nan, nan] if n < self.unknown or _is_in(time, self.invalid) else cranks.tolist()
        if self.wrapped:
            angles = [crank % tau - tau for crank in angles]
        for index, topic in enumerate(self.feedback):
            # Each publisher stamps by its own moment.
            late = time + 0.002 * index
            state = joint_state(self._stamp(late), JOINTS, angles, [rate, rate], [nan, nan])
            yield self._message(topic, STATE, late, state)
        is_known = n >= self.unknown and not _is_in(time, self.invalid)
        if self.solver and self.answers and is_known:
            yield from self._answers(time, cranks)

    def _answers(self, time: float, cranks: Any) -> Iterator[Message]:
        names: list[str] = []
        angles: list[float] = []
        for side, crank in zip(('left', 'right'), cranks.tolist(), strict=True):
            pose = pose_at(crank)
            names += [f'{side}/{joint}' for joint in LEG.joint_names]
            angles += pose.joints
            foot = foot_at(self._stamp(time), [self.scale * x for x in pose.h])
            yield self._message(f'/{side}/point_h', POINT, time, foot)
        state = joint_state(self._stamp(time), names, angles)
        yield self._message('/joint_states', STATE, time, state)

    def _commands(self, n: int, time: float, rate: float) -> Iterator[Message]:
        if self.command_type == TRAJECTORY:
            if n % 50 == 0:
                yield self._message(self.commands, TRAJECTORY, time, trajectory(time))
        elif self.command_type == ARRAY:
            numbers = [rate, rate]
            if 'position' in self.commands:
                numbers = [angle(time), angle(time) + np.pi]
            yield self._message(self.commands, ARRAY, time, {'data': numbers})
        else:
            command = joint_state(self._stamp(time), JOINTS, (), [rate, rate])
            yield self._message(self.commands, STATE, time, command)

    def _stamp(self, time: float) -> int:
        return round(1e9 * (5.0 + time)) if self.sim_rate else at(time)

    def _message(self, name: str, kind: str, time: float, content: Any) -> Message:
        message = filled(kind, content) if isinstance(content, dict) else content
        number = self._numbers[name] = self._numbers.get(name, 0) + 1
        data = bytes(STORE.serialize_cdr(message, kind))
        sent = at(time / (self.sim_rate or 1.0))
        return Message(topic_of(name, kind), data, sent + 200_000, sent, number)


@cache
def pose_at(crank: float) -> KlannPose:
    """Return a pose; most drives have the same ones."""
    return LEG.solve(crank)


def _is_in(time: float, span: tuple[float, float]) -> bool:
    return span[0] <= time < span[1]


def at(time: float) -> int:
    return START + round(1e9 * time)


def velocity(time: float) -> float:
    """Return the commanded velocity [rad/s]."""
    return sum(rate for begin, end, rate in DRIVE if begin <= time < end)


def angle(time: float) -> float:
    """Return the commanded angle [rad]."""
    return sum(rate * (min(max(time, begin), end) - begin) for begin, end, rate in DRIVE)


def trajectory(time: float) -> dict[str, Any]:
    """Return the trajectory of the next two seconds, which begins at once."""
    points = []
    for offset in (0.5, 1.0, 1.5, 2.0):
        later = angle(time + offset)
        duration = {'sec': int(offset), 'nanosec': round(1e9 * (offset % 1.0))}
        points.append({'positions': [later, later + np.pi], 'time_from_start': duration})
    return {'header': leg_header(0), 'joint_names': list(JOINTS), 'points': points}
