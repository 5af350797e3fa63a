"""What pages see of ROS, and what they may have done: the newest of all, ready for JSON."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
import json
from math import atan2, isfinite
from threading import Lock
from time import monotonic
from typing import Any

from klann_ros.live.clients import Answer
from klann_ros.live.drive import crank_at
from klann_ros.live.legs import (
    assumed_solver,
    LiveLeg,
    LiveSolver,
    MAX_LEGS,
    positions,
    replayed_solver,
    solver_of,
)
from klann_ros.live.protocol import Command
from klann_ros.live.rates import TopicRate
from klann_ros.live.status_text import recorded, status_text, StatusText
from klann_ros.log.run_parameters import (
    REPLAYED_PARAMETER,
    replayed_solvers,
    SolverParameters,
)
from klann_ros.nodes.lease import CRANK_STATE
from klann_ros.nodes.recorder.solver_watch import SolverWatch
from klann_ros.sanitize.text import printable
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from .driven import CRANK, Offer, WALK
from .drives import Drives
from .graph import Graph, Machine, Names
from .service_calls import ServiceCalls
from .subscriptions import DIAGNOSTICS, JOINT_STATE, ODOMETRY, SubscribedTopic, TopicSubscriptions

# Period of discovery and figures; shorter at first [s].
_PERIOD, _FIRST_PERIOD = 0.5, 0.1
_FIRST = 5.0
# A status that is not repeated is forgotten after [s].
_FORGET_STATUS = 10.0
_MAX_STATUSES = 60
# What a page may set of a player.
_PLAYER_NUMBERS = {'seek': 'position', 'rate': 'rate'}


@dataclass(frozen=True, eq=False)
class _Shown:
    """A leg on the page: where its poses are found."""

    topic: str
    # Its key: the node's name, and where it plays several topics, the topic.
    solver: str
    leg: LiveLeg


class LiveState:
    """
    The ROS side of the live page.

    Parameters
    ----------
    node : rclpy.node.Node
        Whose it is.
    read_only : bool
        Whether nothing is published, set or called.

    """

    def __init__(self, node: Node, *, read_only: bool) -> None:
        self._node = node
        self._lock = Lock()
        self._version = 0
        self._wake: Callable[[], None] | None = None
        self._parts: dict[str, tuple[int, str]] = {}
        self._shown: list[_Shown] = []
        self._solvers: dict[str, LiveSolver] = {}
        self._replays: dict[str, list[SolverParameters]] = {}
        self._crank_topics: Mapping[str, list[str]] = {}
        self._machines: list[Machine] = []
        self._player_values: dict[str, dict[str, float]] = {}
        self._graph = Graph(node)
        self._calls_to_ros = ServiceCalls(node)
        self._subscriptions = TopicSubscriptions(node, self._bump)
        self._watch = SolverWatch(node, self._on_parameters, [REPLAYED_PARAMETER])
        self._drives = None
        if not read_only:
            self._drives = Drives(
                node, self._calls_to_ros, self._on_drives, self._crank_angle, self._figures_of
            )
        self._began = monotonic()
        self._timer = node.create_timer(
            _FIRST_PERIOD, self._update, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    def close(self) -> None:
        """Stop all that is driven."""
        if self._drives is not None:
            self._drives.close()

    # What pages see; any thread asks.

    @property
    def version(self) -> int:
        """Return a number that grows whenever there is something new."""
        return self._version

    def notify_once(self, wake: Callable[[], None]) -> None:
        """Have a function called once, when there is something new."""
        self._wake = wake

    def parts(self) -> Mapping[str, tuple[int, str]]:
        """Return what changes seldom."""
        return self._parts

    def poses(self) -> str:
        """Return the newest poses, by leg: how old [s], its stamp [s], its coordinates."""
        now, shown = monotonic(), self._shown
        newest = {topic: self._messages(topic) for topic in {leg.topic for leg in shown}}
        found = {}
        for number, leg in enumerate(shown):
            pose = _newest_pose(leg.leg, newest[leg.topic])
            if pose is not None:
                time, stamp, x = pose
                found[number] = [round(now - time, 4), stamp, *x]
        data: dict[str, Any] = {'of': self._parts.get('legs', (0, ''))[0], 'legs': found}
        places = {topic.name: _place(topic) for topic in self._subscriptions.of_kind(ODOMETRY)}
        data['odom'] = {name: place for name, place in places.items() if place}
        return json.dumps(data, separators=(',', ':'))

    # What pages may have done; the server's thread asks.

    def keep_alive(self, page: int) -> None:
        """Note that a page is there."""
        if self._drives is not None:
            self._drives.keep_alive(page)

    def disconnected(self, page: int) -> None:
        """Note that a page is gone: all that it drives stops."""
        if self._drives is not None:
            self._drives.disconnected(page)

    def command(self, page: int, command: Command, answer: Answer) -> None:
        """Do what a page that may drive wants."""
        if self._drives is None:
            answer(False, 'this page may only view')
        elif command.do == 'set':
            self._set(command, answer)
        elif command.do in {'call', *_PLAYER_NUMBERS}:
            self._operate(command, answer)
        else:
            self._drives.command(page, command, answer)

    def _set(self, command: Command, answer: Answer) -> None:
        solver = self._solvers.get(command.what)
        if solver is None or not set(command.values) <= solver.settable:
            answer(False, 'there are no such lengths to set')
            return
        node, values = solver.node, command.values
        self._put(lambda: self._calls_to_ros.set_parameters(node, values, answer), answer)

    def _operate(self, command: Command, answer: Answer) -> None:
        machine = next((m for m in self._machines if m.node == command.what), None)
        if machine is None:
            answer(False, 'it is not there any more')
        elif command.do == 'call' and command.name in machine.services:
            service = f'{machine.node}/{command.name}'
            self._put(
                lambda: self._calls_to_ros.trigger(service, self._asking(machine, answer)), answer
            )
        elif command.do in _PLAYER_NUMBERS and machine.kind == 'player':
            values = {_PLAYER_NUMBERS[command.do]: command.value}
            refresh = self._asking(machine, answer)
            self._put(
                lambda: self._calls_to_ros.set_parameters(machine.node, values, refresh),
                answer,
            )
        else:
            answer(False, 'it cannot do that')

    def _put(self, work: Callable[[], object], answer: Answer) -> None:
        if not self._calls_to_ros.put(work):
            answer(False, 'too much is under way already')

    def _asking(self, machine: Machine, answer: Answer) -> Answer:
        """Return an answer that asks a player where it is by now."""

        def answer_and_refresh(is_done: bool, said: str) -> None:
            answer(is_done, said)
            if machine.kind == 'player':
                self._ask_player(machine.node)

        return answer_and_refresh

    def _crank_angle(self, what: str) -> float:
        """Return the angle of a driven crank, by a leg on it; 0 if unknown."""
        for shown in self._shown:
            topics = self._crank_topics.get(shown.solver, ())
            if any(what == f'{CRANK}:{topic}' for topic in topics):
                pose = _newest_pose(shown.leg, self._messages(shown.topic))
                if pose is not None:
                    return crank_at(pose[2][0], shown.leg.direction, shown.leg.phase)
        return 0.0

    def _figures_of(self, topic: str) -> TopicRate | None:
        topic_subscription = self._subscriptions.topics.get(topic)
        return None if topic_subscription is None else topic_subscription.figures

    def _messages(self, topic: str) -> list[tuple[float, Any]]:
        topic_subscription = self._subscriptions.topics.get(topic)
        return [] if topic_subscription is None else topic_subscription.newest()

    # What happens in ROS's thread.

    def _bump(self) -> None:
        with self._lock:
            self._version += 1
            wake, self._wake = self._wake, None
        if wake is not None:
            wake()

    def _publish_part(self, name: str, data: Any) -> None:
        """Tell the pages a part, if it is another than before."""
        text = json.dumps(data, separators=(',', ':'), allow_nan=False)
        version, before = self._parts.get(name, (0, ''))
        if text != before:
            self._parts = {**self._parts, name: (version + 1, text)}
            self._bump()

    def _on_parameters(self, recorded: SolverParameters) -> None:
        text = recorded.parameters.get(REPLAYED_PARAMETER)
        if isinstance(text, str):
            self._replays[recorded.node] = replayed_solvers(text)
        else:
            self._solvers = {**self._solvers, recorded.node: solver_of(recorded)}
        self._update_legs()

    def _on_drives(self) -> None:
        if self._drives is not None:
            self._publish_part('drives', self._drives.state())

    def _update(self) -> None:
        if self._timer.timer_period_ns < _PERIOD * 1e9 and monotonic() - self._began > _FIRST:
            self._timer.timer_period_ns = int(_PERIOD * 1e9)
        topics = self._graph.topics()
        self._subscriptions.look(topics)
        for topic in self._subscriptions.of_kind(JOINT_STATE):
            self._watch.add(self._graph.publishers(topic.name))
        self._watch.send_requests()
        self._calls_to_ros.look()
        self._update_legs()
        self._update_drives(topics)
        self._update_machines()
        self._publish_part('topics', self._figures())

    def _update_legs(self) -> None:
        shown: list[_Shown] = []
        solvers: dict[str, LiveSolver] = {}
        for topic in self._subscriptions.of_kind(JOINT_STATE):
            known = self._solvers_of(topic)
            solvers.update(known)
            shown += [_Shown(topic.name, key, leg) for key, of in known.items() for leg in of.legs]
        self._shown = shown[:MAX_LEGS]
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
        self._publish_part('legs', data)

    def _solvers_of(self, topic: SubscribedTopic) -> dict[str, LiveSolver]:
        """Return whose legs are on a topic, by their keys."""
        found = {}
        for node in self._graph.names_of_publishers(topic.name):
            if node in self._solvers:
                found[node] = self._solvers[node]
            # A player's parameters never change: a second request is to another one of its name.
            elif node in self._watch.pending:
                continue
            elif self._replays.get(node):
                key = f'{node} {topic.name}'
                found[key] = replayed_solver(node, topic.name, self._replays[node])
            else:
                names = [name for _, message in topic.newest() for name in message.name[:200]]
                if names:
                    found[node] = assumed_solver(node, names)
        return found

    def _update_drives(self, topics: Names) -> None:
        if self._drives is None:
            return
        self._crank_topics = {node: self._graph.crank_topics(node) for node in self._solvers}
        there = {shown.solver for shown in self._shown}
        cranks = {t for node in there for t in self._crank_topics.get(node, ())}
        # Both topics turn a solver's crank.
        offers = [
            self._offer(CRANK, topic, f'{topic.rpartition("/")[0]}/{CRANK_STATE}')
            for topic in sorted(cranks)
        ]
        offers += [self._offer(WALK, topic) for topic in self._graph.walker_topics(topics)]
        self._drives.offer(offers)
        self._on_drives()

    def _offer(self, kind: str, *topics: str) -> Offer:
        publishers = [n for topic in topics for n in self._graph.names_of_publishers(topic)]
        able = self._graph.names_of_subscribers(f'{topics[0]}/lease')
        names = dict.fromkeys(printable(name, 100) for name in publishers)
        yielding = tuple(name for name in names if name in able)
        return Offer(kind, topics[0], topics, tuple(names), yielding)

    def _update_machines(self) -> None:
        before = {machine.node for machine in self._machines}
        self._machines = self._graph.machines()
        there = {machine.node for machine in self._machines}
        self._player_values = {
            node: values for node, values in self._player_values.items() if node in there
        }
        for machine in self._machines:
            if machine.kind == 'player' and machine.node not in before:
                self._ask_player(machine.node)
        statuses = self._statuses()
        self._publish_part('diagnostics', [status.as_data() for _, status in statuses.values()])
        self._publish_part(
            'machines', [self._machine(machine, statuses) for machine in self._machines]
        )

    def _machine(
        self, machine: Machine, statuses: Mapping[str, tuple[Any, StatusText]]
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
            data |= {**recorded(values), 'paused': paused, 'said': found[1].text}
        return data

    def _ask_player(self, node: str) -> None:
        def keep(name: str) -> Callable[[float], None]:
            def set_value(value: float) -> None:
                if isfinite(value):
                    self._player_values[node] = {**self._player_values.get(node, {}), name: value}

            return set_value

        def ask() -> None:
            for name in ('length', 'position', 'rate'):
                self._calls_to_ros.get_number(node, name, keep(name))

        self._calls_to_ros.put(ask)

    def _statuses(self) -> dict[str, tuple[Any, StatusText]]:
        """Return the last status of each name, with what it means."""
        now = monotonic()
        found: dict[str, tuple[Any, StatusText]] = {}
        for topic in self._subscriptions.of_kind(DIAGNOSTICS):
            for time, array in sorted(topic.newest(), key=lambda one: one[0]):
                if now - time > _FORGET_STATUS:
                    continue
                for status in array.status[:_MAX_STATUSES]:
                    values = [(value.key, value.value) for value in status.values[:400]]
                    level = status.level[0] if status.level else 2
                    plain = status_text(level, status.name, status.message, values)
                    if status.name in found or len(found) < _MAX_STATUSES:
                        found[status.name] = status, plain
        return found

    def _figures(self) -> list[dict[str, Any]]:
        found = []
        for _, topic in sorted(self._subscriptions.topics.items()):
            figures = topic.figures
            silence = figures.silence()
            found.append(
                {
                    'name': printable(topic.name),
                    'type': topic.kind,
                    'rate': round(figures.rate(), 1),
                    'lost': figures.lost,
                    'publishers': figures.publishers,
                    'silence': None if silence is None or silence < 2.0 else round(silence),
                }
            )
        return found


def _newest_pose(
    leg: LiveLeg, messages: list[tuple[float, Any]]
) -> tuple[float, float, list[float]] | None:
    """Return when a leg's newest pose came, its stamp [s], and the pose."""
    best = None
    for time, message in messages:
        if best is None or time > best[0]:
            x = positions(leg.joint_names, message.name, message.position)
            if x is not None:
                stamp = message.header.stamp
                best = time, stamp.sec + stamp.nanosec / 1e9, x
    return best


def _place(topic: SubscribedTopic) -> list[float] | None:
    """Return x, y [m], heading [rad], and velocities forward [m/s] and of turning [rad/s]."""
    for _, message in topic.newest()[-1:]:
        at, q = message.pose.pose.position, message.pose.pose.orientation
        yaw = atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))
        twist = message.twist.twist
        place = [at.x, at.y, yaw, twist.linear.x, twist.angular.z]
        if all(map(isfinite, place)):
            return [round(value, 6) for value in place]
    return None
