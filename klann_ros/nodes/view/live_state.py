"""State of the live page from ROS topics, and the commands of pages: service calls and drives."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
import json
from math import isfinite
from time import monotonic
from typing import Any

from klann_ros.kinematics.angles import yaw_of
from klann_ros.live import Answer, Command, crank_at, legs, PageState, recorded, status_text
from klann_ros.log import run_parameters
from klann_ros.nodes.endpoints import create_steady_timer, TypeCheck
from klann_ros.nodes.lease import CRANK_STATE
from klann_ros.nodes.service_calls import BUSY, ServiceCalls
from klann_ros.nodes.solver_watch import SolverWatch
from klann_ros.review import parent
from klann_ros.sanitize.text import printable
from rclpy.node import Node

from .connections import (
    DIAGNOSTICS,
    Graph,
    JOINT_STATE,
    Machine,
    Names,
    ODOMETRY,
    SubscribedTopic,
    TopicSubscriptions,
)
from .drives import CRANK, Drives, Offer, WALK

# Period of discovery; shorter at first [s].
_PERIOD, _FIRST_PERIOD = 0.5, 0.1
_FIRST_TIME = 5.0
# A status that is not repeated is removed after this time [s].
_STATUS_TIMEOUT = 10.0
_MAX_STATUSES = 60
# Parameters of a player that a page may set.
_PLAYER_NUMBERS = {'seek': 'position', 'rate': 'rate'}


@dataclass(frozen=True, eq=False)
class _ShownLeg:
    """A leg on the page, the topic of its poses, and the key of its solver."""

    topic: str
    # The node's name, and if it plays several topics, the topic.
    solver: str
    leg: legs.LiveLeg


class LiveState(PageState):
    """The ROS side of the live page; a read-only one publishes, sets and calls nothing."""

    def __init__(self, node: Node, *, read_only: bool) -> None:
        super().__init__()
        self._shown: list[_ShownLeg] = []
        self._solvers: dict[str, legs.LiveSolver] = {}
        self._replays: dict[str, list[run_parameters.SolverParameters]] = {}
        self._crank_topics: Mapping[str, list[str]] = {}
        self._machines: list[Machine] = []
        self._player_values: dict[str, dict[str, float]] = {}
        self._graph = Graph(node)
        self._types = TypeCheck(node)
        self._calls = ServiceCalls(node)
        self._subscriptions = TopicSubscriptions(node, self.changed)
        self._watch = SolverWatch(node, self._on_parameters, [run_parameters.REPLAYED_PARAMETER])
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
        now, shown = monotonic(), self._shown
        newest = {topic: self._subscriptions.messages(topic) for topic in {s.topic for s in shown}}
        found = {}
        for number, leg in enumerate(shown):
            pose = _newest_pose(leg.leg, newest[leg.topic])
            if pose is not None:
                time, stamp, x = pose
                found[number] = [round(now - time, 4), stamp, *x]
        data: dict[str, Any] = {'of': self.parts.get('legs', (0, ''))[0], 'legs': found}
        places = {topic.name: _place(topic) for topic in self._subscriptions.of_kind(ODOMETRY)}
        data['odom'] = {name: place for name, place in places.items() if place}
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
            self._set(command, answer)
        elif command.command in {'call', *_PLAYER_NUMBERS}:
            self._operate(command, answer)
        else:
            self._drives.command(page, command, answer)

    def _set(self, command: Command, answer: Answer) -> None:
        solver = self._solvers.get(command.target)
        if solver is None or not set(command.values) <= set(solver.lengths):
            answer(False, 'there are no such lengths to set')
            return
        node, values = solver.node, command.values
        self._put(lambda: self._calls.set_parameters(node, values, answer), answer)

    def _operate(self, command: Command, answer: Answer) -> None:
        machine = next((m for m in self._machines if m.node == command.target), None)
        if machine is None:
            answer(False, 'that node has gone')
            return
        node, is_player = machine.node, machine.kind == 'player'

        def answer_and_refresh(is_done: bool, message: str) -> None:
            answer(is_done, message)
            if is_player:
                self._query_player(node)

        if command.command == 'call' and command.name in machine.services:
            service = f'{node}/{command.name}'
            self._put(lambda: self._calls.trigger(service, answer_and_refresh), answer)
        elif command.command in _PLAYER_NUMBERS and is_player:
            values = {_PLAYER_NUMBERS[command.command]: command.value}
            self._put(lambda: self._calls.set_parameters(node, values, answer_and_refresh), answer)
        else:
            answer(False, 'it cannot do that')

    def _put(self, work: Callable[[], object], answer: Answer) -> None:
        if not self._calls.put(work):
            answer(False, BUSY)

    def _crank_angle(self, drive: str) -> float:
        """Return the angle of a driven crank, by a leg on it; 0 if unknown."""
        for shown in self._shown:
            topics = self._crank_topics.get(shown.solver, ())
            if any(drive == f'{CRANK}:{topic}' for topic in topics):
                pose = _newest_pose(shown.leg, self._subscriptions.messages(shown.topic))
                if pose is not None:
                    return crank_at(pose[2][0], shown.leg.direction, shown.leg.phase)
        return 0.0

    # Callbacks in ROS's thread.

    def _on_parameters(self, parameters: run_parameters.SolverParameters) -> None:
        text = parameters.parameters.get(run_parameters.REPLAYED_PARAMETER)
        if isinstance(text, str):
            self._replays[parameters.node] = run_parameters.replayed_solvers(text)
        else:
            self._solvers = {**self._solvers, parameters.node: legs.solver_of(parameters)}
        self._update_legs()

    def _update(self) -> None:
        if self._timer.timer_period_ns < _PERIOD * 1e9 and monotonic() - self._began > _FIRST_TIME:
            self._timer.timer_period_ns = int(_PERIOD * 1e9)
        topics = self._graph.topics()
        self._subscriptions.update(topics)
        self._types.check()
        for topic in self._subscriptions.of_kind(JOINT_STATE):
            self._watch.add(self._graph.publishers(topic.name))
        self._watch.send_requests()
        self._calls.expire()
        self._update_legs()
        self._update_drives(topics)
        self._update_machines()
        subscribed = sorted(self._subscriptions.topics.items())
        self.set_part('topics', [topic.as_data() for _, topic in subscribed])

    def _update_legs(self) -> None:
        shown: list[_ShownLeg] = []
        solvers: dict[str, legs.LiveSolver] = {}
        # Discovery finds them in any order.
        for topic in sorted(self._subscriptions.of_kind(JOINT_STATE), key=lambda of: of.name):
            known = self._solvers_of(topic)
            solvers.update(known)
            shown += [
                _ShownLeg(topic.name, key, leg) for key, of in known.items() for leg in of.legs
            ]
        self._shown = shown[: legs.MAX_LEGS]
        data = []
        for key, solver in solvers.items():
            own = [number for number, leg in enumerate(self._shown) if leg.solver == key]
            data.append(
                {
                    **solver.as_data(),
                    'topics': sorted({printable(self._shown[number].topic) for number in own}),
                    'numbers': own,
                    'cranks': self._crank_topics.get(key, []),
                }
            )
        self.set_part('legs', data)

    def _solvers_of(self, topic: SubscribedTopic) -> dict[str, legs.LiveSolver]:
        """Return the solvers with legs on a topic, by their keys."""
        found = {}
        names = [name for _, message in topic.newest() for name in message.name[:200]]

        def has_joints(solver: legs.LiveSolver) -> bool:
            return any({*names} >= {*leg.joint_names} for leg in solver.legs)

        for node in self._graph.names_of_publishers(topic.name):
            if node in self._solvers:
                # sim_node has a leg's parameters, and publishes its crank alone.
                if not names or has_joints(self._solvers[node]):
                    found[node] = self._solvers[node]
            # A player's parameters never change: a second request is to another of the same name.
            elif node in self._watch.pending:
                continue
            elif self._replays.get(node):
                key = f'{node} {topic.name}'
                found[key] = legs.replayed_solver(node, topic.name, self._replays[node])
            else:
                records = self._described(topic)
                described = legs.replayed_solver(node, topic.name, records) if records else None
                if described and has_joints(described):
                    found[f'{node} {topic.name}'] = described
                elif names:
                    found[node] = legs.assumed_solver(node, names)
        return found

    def _described(self, topic: SubscribedTopic) -> Sequence[run_parameters.SolverParameters]:
        """Return the solvers described beside a topic, or else in another namespace."""
        topics = self._subscriptions.of_kind(run_parameters.STRING_TYPE)
        beside = [each for each in topics if parent(each.name) == parent(topic.name)]
        texts = [m.data for each in beside or topics[:1] for _, m in each.newest()]
        return _described_solvers(tuple(texts))

    def _update_drives(self, topics: Names) -> None:
        if self._read_only:
            return
        self._crank_topics = {node: self._graph.crank_topics(node) for node in self._solvers}
        solvers = {shown.solver for shown in self._shown}
        cranks = {t for node in solvers for t in self._crank_topics.get(node, ())}
        # Both topics turn a solver's crank.
        offers = [
            self._offer(CRANK, topic, f'{topic.rpartition("/")[0]}/{CRANK_STATE}')
            for topic in sorted(cranks)
        ]
        offers += [self._offer(WALK, topic) for topic in self._graph.walker_topics(topics)]
        self._drives.offer(offers)
        self._update_drive_states()

    def _update_drive_states(self) -> None:
        self.set_part('drives', self._drives.state())

    def _offer(self, kind: str, *topics: str) -> Offer:
        publishers = [n for topic in topics for n in self._graph.names_of_publishers(topic)]
        able = self._graph.names_of_subscribers(f'{topics[0]}/lease')
        names = dict.fromkeys(printable(name, 100) for name in publishers)
        yielding = tuple(name for name in names if name in able)
        return Offer(kind, topics[0], topics, tuple(names), yielding)

    def _update_machines(self) -> None:
        before = {machine.node for machine in self._machines}
        self._machines = self._graph.machines()
        names = {machine.node for machine in self._machines}
        self._player_values = {
            node: values for node, values in self._player_values.items() if node in names
        }
        for machine in self._machines:
            if machine.kind == 'player' and machine.node not in before:
                self._query_player(machine.node)
        statuses = self._statuses()
        self.set_part('diagnostics', [text for _, text in statuses.values()])
        self.set_part('machines', [self._machine(m, statuses) for m in self._machines])

    def _machine(
        self, machine: Machine, statuses: Mapping[str, tuple[Any, dict[str, Any]]]
    ) -> dict[str, Any]:
        data: dict[str, Any] = {
            'kind': machine.kind,
            'node': printable(machine.node, 200),
            'services': machine.services,
            **self._player_values.get(machine.node, {}),
        }
        found = statuses.get(f'{machine.node.rpartition("/")[2]}: recording')
        if machine.kind == 'recorder' and found is not None:
            values = [(value.key, value.value) for value in found[0].values]
            paused = dict(values).get('paused') == 'true'
            data |= {**recorded(values), 'paused': paused}
        return data

    def _query_player(self, node: str) -> None:

        def set_values(values: dict[str, float]) -> None:
            if all(map(isfinite, values.values())):
                self._player_values[node] = values

        names = ('length', 'position', 'rate')
        self._calls.put(lambda: self._calls.get_numbers(node, names, set_values))

    def _statuses(self) -> dict[str, tuple[Any, dict[str, Any]]]:
        now = monotonic()
        found: dict[str, tuple[Any, dict[str, Any]]] = {}
        for topic in self._subscriptions.of_kind(DIAGNOSTICS):
            for time, array in sorted(topic.newest(), key=lambda one: one[0]):
                if now - time > _STATUS_TIMEOUT:
                    continue
                for status in array.status[:_MAX_STATUSES]:
                    values = [(value.key, value.value) for value in status.values[:400]]
                    level = status.level[0] if status.level else 2
                    text = status_text(level, status.name, status.message, values)
                    if status.name in found or len(found) < _MAX_STATUSES:
                        found[status.name] = status, text
        return found


@lru_cache(maxsize=8)
def _described_solvers(texts: tuple[str, ...]) -> Sequence[run_parameters.SolverParameters]:
    """Return the solvers that texts describe, without malformed ones; cached, as texts repeat."""
    found = []
    for text in texts:
        with suppress(ValueError):
            found.append(run_parameters.described_solver(text, 0))
    return found


def _newest_pose(
    leg: legs.LiveLeg, messages: list[tuple[float, Any]]
) -> tuple[float, float, list[float]] | None:
    """Return a leg's newest pose: its time of reception [s], its stamp [s], its coordinates."""
    best = None
    for time, message in messages:
        if best is None or time > best[0]:
            x = legs.positions(leg.joint_names, message.name, message.position)
            if x is not None:
                stamp = message.header.stamp
                best = time, stamp.sec + stamp.nanosec / 1e9, x
    return best


def _place(topic: SubscribedTopic) -> list[float] | None:
    """Return x, y [m], heading [rad], and forward [m/s] and turning [rad/s] velocity."""
    for _, message in topic.newest()[-1:]:
        at, q = message.pose.pose.position, message.pose.pose.orientation
        yaw = yaw_of(q.x, q.y, q.z, q.w)
        twist = message.twist.twist
        place = [at.x, at.y, yaw, twist.linear.x, twist.angular.z]
        if all(map(isfinite, place)):
            return [round(value, 6) for value in place]
    return None
