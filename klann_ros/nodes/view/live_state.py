"""State of the live page from ROS topics, and the commands of pages: service calls and drives."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache, partial
import json
from math import isfinite
from operator import attrgetter, itemgetter
from time import monotonic
from typing import Any

from klann_ros.kinematics import NUMBERS
from klann_ros.kinematics.angles import yaw_of
from klann_ros.live import (
    Answer,
    assumed_solver,
    Command,
    crank_at,
    joint_positions,
    LiveLeg,
    LiveSolver,
    MAX_LEGS,
    PageState,
    recorded_counts,
    replayed_solver,
    solver_of,
    status_text,
    walker_data,
    WalkerParts,
)
from klann_ros.log import (
    described_solver,
    REPLAYED_PARAMETER,
    replayed_solvers,
    SolverParameters,
    STRING_TYPE,
)
from klann_ros.nodes.endpoints import create_steady_timer, TypeCheck
from klann_ros.nodes.lease import CRANK_STATE
from klann_ros.nodes.service_calls import BUSY, ServiceCalls
from klann_ros.nodes.solver_watch import SolverWatch
from klann_ros.review import parent
from klann_ros.sanitize.text import printable
from rclpy.node import Node

from .connections import (
    DIAGNOSTICS_TYPE,
    JOINT_STATE_TYPE,
    Machine,
    Names,
    ODOMETRY_TYPE,
    RosGraph,
    SubscribedTopic,
    TopicSubscriptions,
    TRUTH,
)
from .drives import CRANK, Drives, Offer, WALK

# Period of discovery, and the shorter one in the first seconds [s].
_UPDATE_PERIOD = 0.5
_FIRST_PERIOD = 0.1
_FIRST_TIME = 5.0
# A status that is not repeated is removed after this time [s].
_STATUS_TIMEOUT = 10.0
_MAX_STATUSES = 60
# Parameters of a player that a page may set.
_PLAYER_NUMBERS = {'seek': 'position', 'rate': 'rate'}


@dataclass(frozen=True, eq=False)
class _PageLeg:
    """A leg on the page, the topic of its poses, and the key of its solver."""

    topic: str
    # The node's name, and if it plays several topics, the topic.
    solver: str
    leg: LiveLeg


class LiveState(PageState):
    """The ROS side of the live page; a read-only one publishes, sets and calls nothing."""

    def __init__(self, node: Node, *, read_only: bool) -> None:
        super().__init__()
        self._page_legs: list[_PageLeg] = []
        self._solvers: dict[str, LiveSolver] = {}
        self._replays: dict[str, list[SolverParameters]] = {}
        self._crank_topics: Mapping[str, list[str]] = {}
        self._machines: list[Machine] = []
        self._player_values: dict[str, dict[str, float]] = {}
        self._graph = RosGraph(node)
        self._types = TypeCheck(node)
        self._calls = ServiceCalls(node)
        self._subscriptions = TopicSubscriptions(node, self.changed)
        self._watch = SolverWatch(node, self._on_parameters, [REPLAYED_PARAMETER, 'slope'])
        # Parameters of all nodes that are read, by the nodes' names.
        self._parameters: dict[str, dict[str, Any]] = {}
        self._walker_parts = WalkerParts()
        self._read_only = read_only
        self._drives = Drives(
            node,
            self._calls.put,
            self._update_drive_states,
            self._crank_angle,
            self._subscriptions.rate_of,
        )
        self._began = monotonic()
        self._timer = create_steady_timer(node, _FIRST_PERIOD, self._update)

    def close(self) -> None:
        """Stop all drives."""
        self._drives.close()

    def poses(self) -> str:
        """Return the newest poses by leg: age [s], stamp [s], coordinates."""
        now = monotonic()
        messages: dict[str, list[tuple[float, Any]]] = {}
        poses = {}
        for number, page_leg in enumerate(self._page_legs):
            if page_leg.topic not in messages:
                messages[page_leg.topic] = self._subscriptions.messages(page_leg.topic)
            pose = _newest_pose(page_leg.leg, messages[page_leg.topic])
            if pose is not None:
                time, stamp, x = pose
                poses[number] = [round(now - time, 4), stamp, *x]
        odom: dict[str, list[float]] = {}
        truth: dict[str, list[float]] = {}
        for topic in self._subscriptions.of_kind(ODOMETRY_TYPE):
            body_pose = _body_pose(topic)
            if body_pose:
                body_poses = truth if topic.name.endswith(TRUTH) else odom
                body_poses[topic.name] = body_pose
        version, _ = self.parts.get('legs', (0, ''))
        data = {'of': version, 'legs': poses, 'odom': odom, 'truth': truth}
        return json.dumps(data, separators=(',', ':'))

    # Commands of pages, in the server's thread.

    def keep_alive(self, page: int) -> None:
        """Note that a page is connected."""
        self._drives.keep_alive(page)

    def disconnected(self, page: int) -> None:
        """Stop the drives of a closed page."""
        self._drives.disconnected(page)

    def command(self, page: int, command: Command, answer: Answer) -> None:
        """Carry out a command of a page that may drive."""
        if self._read_only:
            answer(False, 'this page may only view')
        elif command.command == 'set':
            self._set_lengths(command, answer)
        elif command.command in {'call', *_PLAYER_NUMBERS}:
            self._operate_machine(command, answer)
        else:
            self._drives.command(page, command, answer)

    def _set_lengths(self, command: Command, answer: Answer) -> None:
        solver = self._solvers.get(command.target)
        if solver is None or not set(command.values) <= set(solver.lengths):
            answer(False, 'there are no such lengths to set')
            return
        work = partial(self._calls.set_parameters, solver.node, command.values, answer)
        self._run_soon(work, answer)

    def _operate_machine(self, command: Command, answer: Answer) -> None:
        """Call a service of a recorder or a player, or set a parameter of a player."""
        machine = next((m for m in self._machines if m.node == command.target), None)
        if machine is None:
            answer(False, 'that node has gone')
            return
        node = machine.node
        is_player = machine.kind == 'player'

        def answer_and_refresh(is_done: bool, message: str) -> None:
            answer(is_done, message)
            if is_player:
                self._query_player(node)

        if command.command == 'call' and command.name in machine.services:
            service = f'{node}/{command.name}'
            self._run_soon(partial(self._calls.trigger, service, answer_and_refresh), answer)
        elif command.command in _PLAYER_NUMBERS and is_player:
            values = {_PLAYER_NUMBERS[command.command]: command.value}
            work = partial(self._calls.set_parameters, node, values, answer_and_refresh)
            self._run_soon(work, answer)
        else:
            answer(False, 'it cannot do that')

    def _run_soon(self, work: Callable[[], object], answer: Answer) -> None:
        if not self._calls.put(work):
            answer(False, BUSY)

    def _crank_angle(self, drive: str) -> float:
        """Return the angle of a driven crank, by its messages or a leg on it; 0 if unknown."""
        topic = drive.removeprefix(f'{CRANK}:')
        # A busy solver answers late: its newest pose may lie behind the crank.
        if (angle := self._last_commanded_angle(topic)) is not None:
            return angle
        for page_leg in self._page_legs:
            if topic in self._crank_topics.get(page_leg.solver, ()):
                pose = _newest_pose(page_leg.leg, self._subscriptions.messages(page_leg.topic))
                if pose is not None:
                    solver = page_leg.leg.solver
                    return crank_at(pose[2][0], solver.direction, solver.phase)
        return 0.0

    def _last_commanded_angle(self, topic: str) -> float | None:
        """Return the last angle on a topic; None without one or where crank_state is newer."""
        state_rate = self._subscriptions.rate_of(_crank_state_topic(topic))
        state_silence = None if state_rate is None else state_rate.silence()
        for received_at, message in self._subscriptions.messages(topic):
            is_newest = state_silence is None or monotonic() - received_at < state_silence
            if is_newest and isfinite(message.data):
                return float(message.data)
        return None

    # Callbacks in ROS's thread.

    def _on_parameters(self, parameters: SolverParameters) -> None:
        self._parameters[parameters.node] = parameters.without_files
        text = parameters.parameters.get(REPLAYED_PARAMETER)
        if isinstance(text, str):
            self._replays[parameters.node] = replayed_solvers(text)
        elif parameters.parameters.keys() >= {*NUMBERS}:
            self._solvers = {**self._solvers, parameters.node: solver_of(parameters)}
        self._update_legs()

    def _update(self) -> None:
        """Follow the graph: subscriptions, solvers, legs, drives and machines."""
        is_settled = monotonic() - self._began > _FIRST_TIME
        if is_settled and self._timer.timer_period_ns < _UPDATE_PERIOD * 1e9:
            self._timer.timer_period_ns = int(_UPDATE_PERIOD * 1e9)
        topics = self._graph.topics()
        self._subscriptions.update(topics)
        self._types.check()
        for topic in self._subscriptions.of_kind(JOINT_STATE_TYPE):
            self._watch.add(self._graph.publishers(topic.name))
        self._watch.send_requests()
        self._calls.expire_calls()
        self._update_legs()
        self._update_drives(topics)
        self._update_machines()
        by_name = self._subscriptions.topics
        self.set_part('topics', [by_name[name].as_data() for name in sorted(by_name)])

    def _update_legs(self) -> None:
        """Set the legs of the page by the solvers that publish them."""
        page_legs: list[_PageLeg] = []
        solvers: dict[str, LiveSolver] = {}
        topics = self._subscriptions.of_kind(JOINT_STATE_TYPE)
        # Discovery finds them in any order.
        for topic in sorted(topics, key=attrgetter('name')):
            for key, solver in self._solvers_of(topic).items():
                solvers[key] = solver
                page_legs += [_PageLeg(topic.name, key, leg) for leg in solver.legs]
        self._page_legs = page_legs[:MAX_LEGS]
        data = []
        for key, solver in solvers.items():
            numbers = [i for i, leg in enumerate(self._page_legs) if leg.solver == key]
            data.append(
                {
                    **solver.as_data(),
                    **self._walker_data(solver),
                    'topics': sorted({printable(self._page_legs[i].topic) for i in numbers}),
                    'numbers': numbers,
                    'cranks': self._crank_topics.get(key, []),
                }
            )
        self.set_part('legs', data)

    def _walker_data(self, solver: LiveSolver) -> dict[str, Any]:
        """Return the body and the floor of a solver's walker, and its parts as soon as made."""
        parameters: dict[str, Any] = {}
        # A simulation beside it knows its floor.
        for node, node_parameters in self._parameters.items():
            if parent(node) == parent(solver.node):
                parameters |= node_parameters
        parts = self._walker_parts.of(solver.parameters) if solver.is_walker else None
        return {**walker_data({**parameters, **solver.parameters}), 'parts': parts}

    def _solvers_of(self, topic: SubscribedTopic) -> dict[str, LiveSolver]:
        """Return the solvers with legs on a topic, by their keys."""
        solvers = {}
        joint_names = [name for _, message in topic.newest() for name in message.name[:200]]

        def has_joints(solver: LiveSolver) -> bool:
            return any({*joint_names} >= {*leg.joint_names} for leg in solver.legs)

        for node in self._graph.names_of_publishers(topic.name):
            if node in self._solvers:
                solvers[node] = self._solvers[node]
            # A player's parameters never change: a second request is to another of the same name.
            elif node in self._watch.pending:
                continue
            elif self._replays.get(node):
                key = f'{node} {topic.name}'
                solvers[key] = replayed_solver(node, topic.name, self._replays[node])
            else:
                records = self._described_beside(topic)
                described = replayed_solver(node, topic.name, records) if records else None
                if described and has_joints(described):
                    solvers[f'{node} {topic.name}'] = described
                elif joint_names:
                    solvers[node] = assumed_solver(node, joint_names)
        # sim_node and a replay have a leg's parameters, and publish its crank alone as well.
        is_silent = not joint_names
        return {k: s for k, s in solvers.items() if is_silent or not s.legs or has_joints(s)}

    def _described_beside(self, topic: SubscribedTopic) -> Sequence[SolverParameters]:
        """Return the solvers described beside a topic, or else in another namespace."""
        descriptions = self._subscriptions.of_kind(STRING_TYPE)
        beside = [d for d in descriptions if parent(d.name) == parent(topic.name)]
        texts: list[str] = []
        for description in beside or descriptions[:1]:
            texts += [message.data for _, message in description.newest()]
        return _described_solvers(tuple(texts))

    def _update_drives(self, topics: Names) -> None:
        """Offer the drives of the solvers' cranks and of the walkers."""
        if self._read_only:
            return
        self._crank_topics = {node: self._graph.crank_topics(node) for node in self._solvers}
        crank_topics: set[str] = set()
        for page_leg in self._page_legs:
            crank_topics.update(self._crank_topics.get(page_leg.solver, ()))
        offers = []
        for topic in sorted(crank_topics):
            # Both topics turn a solver's crank.
            offers.append(self._make_offer(CRANK, topic, _crank_state_topic(topic)))
        offers += [self._make_offer(WALK, topic) for topic in self._graph.walker_topics(topics)]
        self._drives.offer(offers)
        self._update_drive_states()

    def _update_drive_states(self) -> None:
        self.set_part('drives', self._drives.state())

    def _make_offer(self, kind: str, *topics: str) -> Offer:
        publishers: dict[str, None] = {}
        for topic in topics:
            for name in self._graph.names_of_publishers(topic):
                publishers[printable(name, 100)] = None
        listeners = self._graph.names_of_subscribers(f'{topics[0]}/lease')
        yielding = tuple(name for name in publishers if name in listeners)
        return Offer(kind, topics[0], topics, tuple(publishers), yielding)

    def _update_machines(self) -> None:
        old_nodes = {machine.node for machine in self._machines}
        self._machines = self._graph.machines()
        nodes = {machine.node for machine in self._machines}
        for node in self._player_values.keys() - nodes:
            del self._player_values[node]
        for machine in self._machines:
            if machine.kind == 'player' and machine.node not in old_nodes:
                self._query_player(machine.node)
        statuses = self._statuses()
        self.set_part('diagnostics', [text for _, text in statuses.values()])
        self.set_part('machines', [self._machine_data(m, statuses) for m in self._machines])

    def _machine_data(
        self, machine: Machine, statuses: Mapping[str, tuple[Any, dict[str, Any]]]
    ) -> dict[str, Any]:
        data: dict[str, Any] = {
            'kind': machine.kind,
            'node': printable(machine.node, 200),
            'services': machine.services,
            **self._player_values.get(machine.node, {}),
        }
        recording = statuses.get(f'{machine.node.rpartition("/")[2]}: recording')
        if machine.kind == 'recorder' and recording is not None:
            values = [(pair.key, pair.value) for pair in recording[0].values]
            states = dict(values)
            data |= {
                **recorded_counts(values),
                'paused': states.get('paused') == 'true',
                # Without a file it waits for a trigger.
                'writes': bool(states.get('file')),
            }
        return data

    def _query_player(self, node: str) -> None:

        def set_values(values: dict[str, float]) -> None:
            if all(map(isfinite, values.values())):
                self._player_values[node] = values

        names = ('length', 'position', 'rate')
        self._calls.put(lambda: self._calls.get_numbers(node, names, set_values))

    def _statuses(self) -> dict[str, tuple[Any, dict[str, Any]]]:
        now = monotonic()
        statuses: dict[str, tuple[Any, dict[str, Any]]] = {}
        for topic in self._subscriptions.of_kind(DIAGNOSTICS_TYPE):
            for time, array in sorted(topic.newest(), key=itemgetter(0)):
                if now - time > _STATUS_TIMEOUT:
                    continue
                for status in array.status[:_MAX_STATUSES]:
                    values = [(pair.key, pair.value) for pair in status.values[:400]]
                    level = status.level[0] if status.level else 2
                    text = status_text(level, status.name, status.message, values)
                    if status.name in statuses or len(statuses) < _MAX_STATUSES:
                        statuses[status.name] = status, text
        return statuses


@lru_cache(maxsize=8)
def _described_solvers(texts: tuple[str, ...]) -> Sequence[SolverParameters]:
    """Return the solvers that texts describe, without malformed ones; cached, as texts repeat."""
    solvers = []
    for text in texts:
        with suppress(ValueError):
            solvers.append(described_solver(text, 0))
    return solvers


def _crank_state_topic(crank_angle_topic: str) -> str:
    return f'{crank_angle_topic.rpartition("/")[0]}/{CRANK_STATE}'


def _newest_pose(
    leg: LiveLeg, messages: list[tuple[float, Any]]
) -> tuple[float, float, list[float]] | None:
    """Return a leg's newest pose: its time of reception [s], its stamp [s], its coordinates."""
    newest = None
    for time, message in messages:
        if newest is None or time > newest[0]:
            x = joint_positions(leg.joint_names, message.name, message.position)
            if x is not None:
                stamp = message.header.stamp
                newest = time, stamp.sec + stamp.nanosec / 1e9, x
    return newest


def _body_pose(topic: SubscribedTopic) -> list[float] | None:
    """
    Return the newest pose of a body.

    It is x, y [m], heading [rad], forward [m/s] and turning [rad/s] velocity, z [m], and the
    attitude's quaternion: x, y, z, w.
    """
    for _, message in topic.newest()[-1:]:
        position = message.pose.pose.position
        q = message.pose.pose.orientation
        attitude = [q.x, q.y, q.z, q.w]
        yaw = yaw_of(*attitude)
        twist = message.twist.twist
        velocity = [twist.linear.x, twist.angular.z]
        numbers = [position.x, position.y, yaw, *velocity, position.z, *attitude]
        if all(map(isfinite, numbers)) and any(attitude):
            return [round(number, 6) for number in numbers]
    return None
