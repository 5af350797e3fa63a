"""Runs made by the real solver and the real writer, without ROS: a message is its CDR bytes."""

from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field, replace
from functools import cache, lru_cache
import math
from pathlib import Path
import struct
from types import MappingProxyType
from typing import Any

from klann_ros.dynamics import Dynamics, rods
from klann_ros.kinematics import KinematicsError, KlannGeometry, KlannLeg
from klann_ros.kinematics.klann import JOINTS
from klann_ros.log.qos import Qos, qos_to_yaml
from klann_ros.log.reader import open_log
from klann_ros.log.records import Message, Topic
from klann_ros.log.run_parameters import (
    leg_description,
    LOSS_RECORD,
    loss_record,
    Pause,
    PAUSE_RECORD,
    pause_record,
    SOLVER_RECORD,
    solver_record,
    SolverParameters,
    TopicCount,
)
from klann_ros.log.write.writer import RunWriter
from klann_ros.review.command import main
from leg_runs import filled, foot_at, joint_state, make, POINT, START, STATE, STORE, topic_of
import numpy as np
from playable_logs import text
import pytest
from xacro_legs import ROOT, urdf_of

PERIOD = 5_000_000
STRING = 'std_msgs/msg/String'
CRANK = topic_of('/crank_angle', 'std_msgs/msg/Float64')
POSES = topic_of('/joint_states', STATE)
FEET = topic_of('/point_h', POINT)


@dataclass
class Answer:
    """A crank angle and what was answered; all at one time by default."""

    stamp: int
    alpha: float
    pose: list[float]
    foot: tuple[float, float]
    sequence: int
    header_stamp: int | None = None
    foot_stamp: int | None = None

    def solved(self, leg: KlannLeg, alpha: float, asked: float | None = None) -> 'Answer':
        """Return the answer of a leg at an angle, which is that of the crank by default."""
        pose = leg.solve(alpha)
        asked = pose.alpha if asked is None else asked
        return replace(self, alpha=asked, pose=list(pose.joints), foot=pose.h)


@dataclass
class Script:
    """What a run is made of; a test changes one thing in it."""

    geometry: KlannGeometry | None = field(default_factory=KlannGeometry)
    answers: list[Answer] = field(default_factory=list)
    # Log time and stamp [ns], and crank angle.
    unanswered: list[tuple[int, int, float]] = field(default_factory=list)
    parameters: dict[str, Any] = field(default_factory=dict)
    metadata: list[tuple[str, dict[str, str]]] = field(default_factory=list)
    messages: list[Message] = field(default_factory=list)
    others: list['Script'] = field(default_factory=list)
    # Numbers of the messages of a topic that are lost, or received later by a time [ns].
    lost: dict[str, range] = field(default_factory=dict)
    late: dict[str, tuple[range, int]] = field(default_factory=dict)
    # Numbers of the messages of a topic with another log time [ns].
    misdated: dict[str, tuple[range, int]] = field(default_factory=dict)
    namespace: str = ''
    prefix: str = ''
    rates: list[float] = field(default_factory=list)
    # One for each answer: of the crank's joint beside a wheel's, and of all joints of the leg.
    crank_efforts: Sequence[float] = ()
    pose_efforts: Sequence[float] = ()
    latency: int = 200_000
    # Whether the messages are numbered over all topics.
    numbered_by_file: bool = False
    crank: Topic = CRANK
    poses: Topic = POSES
    feet: Topic = FEET

    def do(self, step: dict[str, Any]) -> None:
        """Do a step of a situation: call a method by its name with words, the last ones named."""
        ((name, argument),) = step.items()
        if name == 'other':
            self.others[-1].do(argument)
        elif name == 'recorded':
            self.geometry = argument and KlannGeometry(**argument)
        elif name == 'parameters':
            self.parameters |= argument
        elif name == 'linkage':
            file = ROOT / 'klann_ros' / 'linkages' / f'{argument}.yaml'
            self.parameters['linkage_description'] = file.read_text(encoding='utf-8')
        else:
            words = [*argument] if isinstance(argument, list) else [argument]
            are_named = name not in ('add_counts', 'record', 'describe_leg')
            options = words.pop() if are_named and words and isinstance(words[-1], dict) else {}
            getattr(self, name)(*words, **options)

    def change(self, index: int, **fields: Any) -> None:
        self.answers[index] = replace(self.answers[index], **fields)

    def move(self, index: int, alpha: float) -> None:
        """Set another crank angle, with its pose and its foot."""
        self.answers[index] = self.answers[index].solved(KlannLeg(self.geometry), alpha)

    def delay(self, first: int, delay: int, last: int | None = None, every: int = 1) -> None:
        """Send the answers from the first on later [ns]."""
        for n in range(len(self.answers))[first:last:every]:
            self.change(n, stamp=self.answers[n].stamp + delay)

    def solve(self, index: int, error: float = 0.0, last: int = 0, **geometry: Any) -> None:
        """Answer with the pose of another angle, or with some of another leg."""
        leg = KlannLeg(replace(self.geometry or KlannGeometry(), **geometry))
        for n in range(index, max(last, index + 1)):
            asked = self.answers[n].alpha
            self.answers[n] = self.answers[n].solved(leg, asked + error, asked)

    def turn(self, first: int, angle: float, last: int | None = None, every: int = 1) -> None:
        """Turn the crank further at some angles [rad]."""
        for n in range(len(self.answers))[first:last:every]:
            self.move(n, self.answers[n].alpha + angle)

    def spoil(self, index: int, joint: int, error: float) -> None:
        """Answer with an angle that is wrong by an error, or that is NaN or infinite."""
        pose = self.answers[index].pose
        pose[joint] = pose[joint] + error if math.isfinite(error) else error

    def drift(self, first: int, distance: float) -> None:
        """Move the foot in y from an answer on [m]."""
        for n in range(first, len(self.answers)):
            x, y = self.answers[n].foot
            self.change(n, foot=(x, y + distance))

    def measure_in_degrees(self, decimals: int) -> None:
        """Answer with poses in degrees."""
        for answer in self.answers:
            answer.pose = np.degrees(answer.pose).round(decimals).tolist()

    def round_angles(self, decimals: int | None = None) -> None:
        """Answer with poses of some decimals, or of 32 bits."""
        for answer in self.answers:
            pose = np.array(answer.pose)
            rounded = np.float32(pose) if decimals is None else pose.round(decimals)
            answer.pose = rounded.astype(np.float64).tolist()

    def ask_in_degrees(self, decimals: int = 9, answered: bool = False) -> None:
        """Ask in degrees below 360; they are answered as radians, or rightly."""
        for n, answer in enumerate(self.answers):
            alpha = round(math.degrees(answer.alpha), decimals)
            if answered:
                self.move(n, alpha % 360.0)
            else:
                self.change(n, alpha=alpha)

    def wrap(self) -> None:
        """Ask for angles within (-pi, pi]."""
        for n, answer in enumerate(self.answers):
            self.change(n, alpha=math.remainder(answer.alpha, math.tau))

    def stand(self, first: int, last: int) -> None:
        """Let the crank stand still from one answer to another."""
        still = self.answers[first]
        skipped = self.answers[last].alpha - still.alpha
        for n in range(first + 1, last):
            self.change(n, alpha=still.alpha, pose=still.pose, foot=still.foot)
        self.turn(last, -skipped)

    def cut(self, first: int, last: int | None = None) -> None:
        """Leave out answers with their inputs: their sequence numbers are missing."""
        del self.answers[first:last]

    def number(self, first: int, start: int, every: int = 1) -> None:
        """Set the sequence numbers of messages from an answer on."""
        for n in range(first, len(self.answers), every):
            self.change(n, sequence=start + n - first)

    def unnumber(self) -> None:
        """Take the sequence numbers away."""
        self.answers = [replace(answer, sequence=0) for answer in self.answers]

    def simulate(self, later: int = 0) -> None:
        """Stamp by a simulated clock, which ten answers share."""
        self.parameters['use_sim_time'] = True
        for n in range(len(self.answers)):
            self.change(n, header_stamp=50_000_000 * (1 + (n + later) // 10))

    def clock(self, late: int = 0, pause: int = 0) -> None:
        """Stamp late by a /clock of half the speed, which pauses midway [ns]."""
        self.by_crank_state()
        topic = Topic('/clock', 'rosgraph_msgs/msg/Clock', '')
        start = self.answers[0].stamp
        for n, answer in enumerate(self.answers):
            simulated = (answer.stamp - start) // 2 + 5_000_000_000
            stamp = answer.stamp + pause * (2 * n >= len(self.answers))
            self.change(n, stamp=stamp, header_stamp=simulated - late)
            data = struct.pack('<4BII', 0, 1, 0, 0, *divmod(simulated, 10**9))
            self.messages.append(Message(topic, data, stamp + 1_000_000, stamp, n + 1))

    def tick(self, count: int) -> None:
        """Stamp a number of answers alike."""
        for n in range(len(self.answers)):
            self.change(n, header_stamp=self.answers[n - n % count].stamp)

    def events(self, name: str, kind: str, late: int, *times: int) -> None:
        """Add messages of another topic, by default in four bursts of twelve [ms]."""
        bursts = [500 * burst + n for burst in range(4) for n in range(12)]
        for ms in times or bursts:
            time = START + 1_000_000 * ms
            topic = Topic(name, kind, '')
            self.messages.append(Message(topic, b'', time + late, time, 0))

    def stream(
        self, name: str, kind: str, *spans: list[int], restarts: bool = False, late: int = 0
    ) -> None:
        """Add messages of another topic at 100 Hz in some times [ms]; they are late by some ms."""
        topic = Topic(name, kind, '')
        number = 0
        for begin, end in spans:
            number = 0 if restarts else number
            for ms in range(begin, end, 10):
                number += 1
                time = START + 1_000_000 * ms
                self.messages.append(Message(topic, b'', time + 1_000_000 * late, time, number))

    def lease(self, begin: int, end: int, *, released: bool = True) -> None:
        """Let a driver hold the lease of the crank for some time [ms]."""
        topic = topic_of(f'{self.crank.name}/lease', 'diagnostic_msgs/msg/KeyValue')
        times = [*range(begin, end, 100), *[end] * released]
        for ms in times:
            value = 'held' if ms < end else 'released'
            content = filled(topic.type, {'key': 'driver#1', 'value': value})
            self.messages.append(message(topic, START + 1_000_000 * ms, 0, content))

    def garble(self, topic: str, *contents: str) -> None:
        """Add messages of these bytes at half a second."""
        for time, content in enumerate(contents, START + 500_200_000):
            data = content.encode('latin-1')
            self.messages.append(Message(getattr(self, topic), data, time, time, 0))

    def describe(
        self, robot: str, seconds: float = 0.0, topic: str = '/robot_description', **numbers: float
    ) -> None:
        """Publish the URDF of a robot, a shipped one by its name, with other lengths of bars."""
        time = START + round(1e9 * seconds)
        if robot == 'patent':
            robot = urdf_of(ROOT / 'config' / 'patent.yaml')
        elif robot.isidentifier():
            robot = (ROOT / 'urdf' / f'{robot}.urdf').read_text(encoding='utf-8')
        for name, length in numbers.items():
            robot = robot.replace(f'{getattr(KlannGeometry(), name)} 0 0', f'{length} 0 0')
        self.messages.append(Message(topic_of(topic, STRING), text(robot), time + 1000, time, 0))

    def describe_leg(self, parameters: dict[str, float], seconds: float = 0.0) -> None:
        """Publish the parameters of a leg as solver_node does."""
        time = START + round(1e9 * seconds)
        words = leg_description(SolverParameters('/solver_node', time, parameters))
        topic = topic_of('/leg_description', STRING)
        self.messages.append(Message(topic, text(words), time, time, 1))

    def alter(self, topic: str, **fields: str) -> None:
        """Give a topic another name, type or definition."""
        setattr(self, topic, replace(getattr(self, topic), **fields))

    def swing(
        self,
        scale: float = 1.0,
        friction: float = 0.0,
        steps: int = 0,
        of_poses: bool = False,
        outliers: Mapping[int, float] = MappingProxyType({}),
        **parameters: Any,
    ) -> None:
        """Let the speed of the crank swing, with some of the torque for it as efforts [N m]."""
        self.by_crank_state()
        self.parameters = {'bar_density': 1.0, 'foot_mass': 0.2, **parameters}
        times = PERIOD / 1e9 * np.arange(len(self.answers))
        alphas = 0.3 + 6.0 * times + 0.4 * np.sin(5.0 * times)
        rates = 6.0 + 2.0 * np.cos(5.0 * times)
        dynamics = Dynamics(KlannGeometry(), rods(KlannGeometry(), 1.0, foot_mass=0.2))
        torque = dynamics.crank_torque(alphas, rates, -10.0 * np.sin(5.0 * times))
        efforts = scale * torque + friction * np.sign(rates)
        efforts[list(outliers)] = list(outliers.values())
        sense = self.parameters.get('direction', 1)
        phase = self.parameters.get('phase', 0.0)
        leg = KlannLeg()
        for n, alpha in enumerate(alphas):
            # An encoder counts steps of a turn.
            angle = (alpha - phase) / sense
            angle = math.tau / steps * round(angle * steps / math.tau) if steps else angle
            self.answers[n] = self.answers[n].solved(leg, sense * angle + phase, angle)
        if of_poses:
            self.pose_efforts = efforts
        else:
            self.crank_efforts = sense * efforts

    def reach(self, **geometry: float) -> None:
        """Answer by a leg that cannot reach all angles."""
        self.geometry = KlannGeometry(**geometry)
        leg = KlannLeg(self.geometry)
        asked = self.answers
        self.answers = []
        for answer in asked:
            try:
                self.answers.append(answer.solved(leg, answer.alpha))
            except KinematicsError:
                self.unanswered.append((answer.stamp, answer.stamp, answer.alpha))
        self.renumber()

    def restart(self, index: int) -> None:
        """Record the solver once more, at the time of an answer."""
        self.add_solver(self.answers[index].stamp + self.latency, self.geometry)

    def change_leg(self, index: int, **geometry: Any) -> None:
        """Answer with another leg until an answer, from whose time on its own is recorded."""
        self.restart(index)
        self.geometry = KlannGeometry(**geometry)
        for n in range(index):
            self.move(n, self.answers[n].alpha)

    def silence(self, first: int, last: int) -> None:
        """Leave inputs without an answer, which has no number either."""
        for answer in self.answers[first:last]:
            self.unanswered.append((answer.stamp, answer.stamp, answer.alpha))
        self.cut(first, last)
        self.renumber()

    def lose(self, topic: str, first: int, last: int) -> None:
        """Lose the messages of a topic with these numbers, the last one excluded."""
        self.lost[topic] = range(first, last)

    def detain(self, topic: str, first: int, last: int, delay: int) -> None:
        """Receive the messages of a topic with these numbers later [ns]."""
        self.late[topic] = range(first, last), delay

    def misdate(self, topic: str, first: int, last: int, time: int) -> None:
        """Log the messages of a topic with these numbers at a time [ns]."""
        self.misdated[topic] = range(first, last), time

    def pause(self, index: int, begin: int, end: int, *reason: str) -> None:
        """Add a pause of the recorder, from the times of an answer and of the next [ns]."""
        begin += self.answers[index].stamp
        end += self.answers[index + 1].stamp
        pause = Pause(begin, end, {}, *reason)
        self.metadata.append((PAUSE_RECORD, pause_record(pause)))

    def share(self, topic: str) -> None:
        """Give a topic two publishers."""
        self.alter(topic, qos=qos_to_yaml([Qos(), Qos()]))

    def second(
        self,
        phase: float = 0.0,
        first: int = 0,
        last: int | None = None,
        node: str = '',
        legs: Sequence[str] = (),
        **geometry: Any,
    ) -> None:
        """Let another solver answer the same inputs; a named one is recorded."""
        leg = KlannLeg(KlannGeometry(**geometry))
        if node:
            parameters = {'legs': legs} if legs else {}
            self.add_solver(self.answers[0].stamp + 1_000_000, leg.geometry, node, **parameters)
        self.repeat(
            [
                answer.solved(leg, answer.alpha + phase, answer.alpha)
                for answer in self.answers[first:last]
            ]
        )

    def repeat(self, answers: list[Answer] | None = None) -> None:
        """Let another solver give these answers, or the same."""
        answers = [*self.answers] if answers is None else answers
        # Its inputs are those of the first.
        topics = {'crank': replace(self.crank, name='/other'), 'poses': self.poses}
        latency = self.latency + 1_000_000
        script = Script(None, answers, feet=self.feet, latency=latency, **topics)
        self.others.append(script)

    def shift_header_stamps(self, offset: int) -> None:
        for n, answer in enumerate(self.answers):
            self.change(n, header_stamp=answer.stamp + offset)

    def assign(self, **fields: Any) -> None:
        """Set fields, such as the latency of all messages [ns]."""
        vars(self).update(fields)

    def record(self, name: str, content: dict[str, str]) -> None:
        """Add a record of the recorder."""
        self.metadata.append((f'klann_ros.{name}', content))

    def add_counts(self, counts: dict[str, TopicCount | dict[str, int | None]]) -> None:
        """Add what the recorder counted."""
        topic_counts = {}
        for name, count in counts.items():
            topic_counts[name] = TopicCount(**count) if isinstance(count, dict) else count
        self.metadata.append((LOSS_RECORD, loss_record(topic_counts)))

    def renumber(self) -> None:
        """Set the numbers of the answers that are left, without a gap."""
        self.answers = [replace(answer, sequence=n + 1) for n, answer in enumerate(self.answers)]

    def swap_stamps(self, first: int, second: int) -> None:
        self.change(first, header_stamp=self.answers[second].stamp)
        self.change(second, header_stamp=self.answers[first].stamp)

    def ask_unstamped(self, index: int) -> None:
        """Add an input without a stamp, logged behind an answered one."""
        asked = self.answers[index]
        content = crank(self.crank, 0, asked.alpha)
        self.messages.append(message(self.crank, asked.stamp + 1000, 0, content))

    def ask(self, index: int, later: int = 1000, alpha: float | None = None) -> None:
        """Add an input without an answer, behind an answered one by a time [ns]."""
        asked = self.answers[index]
        stamp = asked.stamp if asked.header_stamp is None else asked.header_stamp
        alpha = asked.alpha if alpha is None else alpha
        self.unanswered.append((asked.stamp + later, stamp + later, alpha))

    def add_solver(
        self, time: int, geometry: KlannGeometry, node: str = '/solver_node', **parameters: Any
    ) -> None:
        parameters = {**geometry.as_dict(), **parameters}
        record = solver_record(SolverParameters(node, time, parameters))
        self.metadata.append((SOLVER_RECORD, record))

    def in_namespace(self, namespace: str, solver: str = '') -> 'Script':
        """Return the run with its topics in a namespace, and its solver there or elsewhere."""
        self.namespace = solver or namespace
        for field_name in ('crank', 'poses', 'feet'):
            self.alter(field_name, name=namespace + getattr(self, field_name).name)
        return self

    def beside(self, namespace: str) -> None:
        """Add a leg in another namespace."""
        self.others.append(script().in_namespace(namespace))

    def as_leg(self, name: str) -> None:
        """Publish as a leg of a walker does."""
        self.prefix = f'{name}/'
        self.alter('feet', name=f'/{name}/point_h')

    def by_crank_state(self) -> 'Script':
        """Return the run with a JointState as its input: it has stamps of its own."""
        self.crank = replace(POSES, name='/crank_state')
        return self


def script(geometry: KlannGeometry | None = None, turns: float = 2.0, count: int = 400) -> Script:
    """Return a healthy run of the crank."""
    geometry = geometry or KlannGeometry()
    # Their poses may be changed.
    answers = deepcopy(healthy_answers(geometry, turns, count))
    return Script(geometry=geometry, answers=[*answers])


@cache
def healthy_answers(geometry: KlannGeometry, turns: float, count: int) -> tuple[Answer, ...]:
    """Return the answers of a healthy run; most tests begin with the same ones."""
    leg = KlannLeg(geometry)
    answers = []
    for n in range(count):
        answer = Answer(START + n * PERIOD, 0.0, [], (0.0, 0.0), n + 1)
        answers.append(answer.solved(leg, 0.3 + turns * math.tau * n / (count - 1)))
    return tuple(answers)


def write(script: Script, folder: Path) -> Path:
    with RunWriter(folder) as run:
        for name, content in metadata(script):
            run.add_metadata(name, content)
        received = sorted(_received(script), key=lambda message: message.log_time)
        for number, message in enumerate(received, start=1):
            numbers, time = script.misdated.get(message.topic.name, ((), 0))
            is_misdated = message.sequence in numbers
            if script.numbered_by_file:
                message = replace(message, sequence=number)  # noqa: PLW2901
            run.write(replace(message, log_time=time) if is_misdated else message)
    return folder


def _received(script: Script) -> Iterator[Message]:
    """Yield the messages that are not lost, as they are received."""
    for message in messages(script):
        name = message.topic.name
        late, delay = script.late.get(name, ((), 0))
        if message.sequence in late:
            yield replace(message, log_time=message.log_time + delay)
        elif message.sequence not in script.lost.get(name, ()):
            yield message


def metadata(script: Script) -> Iterator[tuple[str, dict[str, str]]]:
    if script.geometry is not None:
        parameters = {**script.geometry.as_dict(), **script.parameters}
        node = f'{script.namespace}/solver_node'
        yield SOLVER_RECORD, solver_record(SolverParameters(node, START, parameters))
    yield from script.metadata
    for other in script.others:
        yield from metadata(other)


def messages(script: Script) -> Iterator[Message]:
    for time, stamp, alpha in script.unanswered:
        yield message(script.crank, time, 0, crank(script.crank, stamp, alpha))
    for answer in script.answers:
        yield from _answer(script, answer)
    yield from script.messages
    for other in script.others:
        yield from messages(other)


def crank(topic: Topic, stamp: int, alpha: float) -> Any:
    if topic.type == CRANK.type:
        return make(CRANK.type, data=alpha)
    return joint_state(stamp, ['crank'], [alpha])


def _answer(script: Script, answer: Answer) -> Iterator[Message]:
    time = answer.stamp
    number = answer.sequence
    stamp = time if answer.header_stamp is None else answer.header_stamp
    names = tuple(script.prefix + joint for joint in JOINTS)
    foot_stamp = stamp if answer.foot_stamp is None else answer.foot_stamp
    asked: tuple[Any, ...] = crank, script.crank, stamp, answer.alpha
    if len(script.crank_efforts):
        efforts = 77.0, script.crank_efforts[number - 1]
        asked = joint_state, stamp, ('wheel', 'crank'), (0.0, answer.alpha), (), efforts
    first = number - 1
    efforts = tuple(map(float, script.pose_efforts[first:number])) * len(names)
    pose = joint_state, stamp, names, tuple(answer.pose), tuple(script.rates), efforts
    for topic, content in (
        (script.crank, asked),
        (script.poses, pose),
        (script.feet, (foot_at, foot_stamp, tuple(answer.foot))),
    ):
        data = _serialized(*content)
        yield Message(topic, data, time + script.latency, time, number)


@lru_cache(1 << 14)
def _serialized(make_content: Callable[..., Any], *arguments: Hashable) -> bytes:
    """Return the bytes of a message; in most runs nearly all are the same."""
    content = make_content(*arguments)
    return bytes(STORE.serialize_cdr(content, content.__msgtype__))


def message(
    topic: Topic, time: int, sequence: int, content: Any, latency: int = 200_000
) -> Message:
    data = bytes(STORE.serialize_cdr(content, topic.type))
    return Message(topic, data, time + latency, time, sequence)


@pytest.fixture
def make_run(tmp_path: Path) -> Callable[..., Path]:
    return lambda script, name='run': write(script, tmp_path / name)


@pytest.fixture
def printed(
    make_run: Callable[..., Path], capsys: pytest.CaptureFixture[str]
) -> Callable[..., str]:
    """Return what writes a run, reviews it, and returns the report."""

    def report(script: Script, *arguments: str, code: int = 0) -> str:
        assert main([str(make_run(script)), *arguments]) == code
        return capsys.readouterr().out

    return report


@pytest.fixture
def healthy() -> Script:
    return script()


@pytest.fixture(scope='session')
def make_script() -> Callable[..., Script]:
    return script


@pytest.fixture(scope='session')
def situation_of() -> Callable[[dict[str, Any]], Script]:
    """Return what makes a situation: a healthy run, and one thing done to it after the other."""

    def make_situation(situation: dict[str, Any]) -> Script:
        options = {**situation.get('run', {})}
        leg = options.pop('geometry', {})
        geometry = KlannGeometry.patent() if leg == 'patent' else KlannGeometry(**leg)
        run = script(geometry, **options)
        for step in situation.get('do', ()):
            run.do(step)
        return run

    return make_situation


@pytest.fixture(scope='session')
def messages_of() -> Callable[[Script], Iterator[Message]]:
    return messages


class Rewriter:
    """Writes runs from the messages of others, with the log library."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._count = 0

    @staticmethod
    def read(run: Path) -> list[Message]:
        with open_log(run) as log:
            return list(log.messages())

    def __call__(self, run: Path, changed: list[Message], **options: Any) -> Path:
        """Write messages in this order, with the metadata of a run; return the new run."""
        self._count += 1
        folder = self._folder / f'{run.name}_{self._count}'
        with open_log(run) as log, RunWriter(folder, **options) as writer:
            for name, records in log.metadata.items():
                for record in records if name.startswith('klann_ros.') else ():
                    writer.add_metadata(name, record)
            for message in changed:
                writer.write(message)
        return folder


@pytest.fixture
def write_messages(tmp_path: Path) -> Rewriter:
    return Rewriter(tmp_path)
