"""Real nodes as real processes over real DDS, and a probe that talks to them."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
import os
from pathlib import Path
import re
import signal
import subprocess
import sys
import time
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from fork_server import ForkedProcess, PACKAGE, server
from klann_ros.nodes.parameters import prepare_sets
from klann_ros.nodes.solver.node import ManagedSolverNode, SolverNode
from patience import PATIENCE
from rcl_interfaces.srv import GetParameters, SetParameters, SetParametersAtomically
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile, ReliabilityPolicy

# Timeout of a node that answers no requests [s].
SILENT = 10.0
SHARED_MEMORY = Path('/dev/shm')  # noqa: S108 - Fast DDS's place, not ours
# The segments of one process. Its ports are shared: some have the same number in all domains.
SEGMENT = re.compile(rf'{SHARED_MEMORY}/(fast(?:rtps|dds)_[0-9a-f]{{16}})\b')
# Traffic never leaves the machine, neither the probe's nor that of its processes.
os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
# Fast DDS 3 (Kilted) has another name for the variable, and others in the file.
LIBRARIES = os.environ.get('LD_LIBRARY_PATH', '').split(os.pathsep)
IS_FAST_DDS_3 = any(Path(folder, 'libfastdds.so').exists() for folder in LIBRARIES)
PROFILES_VARIABLE = f'FAST{"DDS" if IS_FAST_DDS_3 else "RTPS"}_DEFAULT_PROFILES_FILE'
PROFILES = 'fastdds_3.xml' if IS_FAST_DDS_3 else 'fastdds.xml'
os.environ[PROFILES_VARIABLE] = str(Path(__file__).with_name(PROFILES))


class Process:
    """
    An executable of the checkout, as a process.

    A wrapper, if there is one, starts it; options are those of Popen. Without either it is forked
    by a server, unless it needs a fresh Python.
    """

    def __init__(
        self,
        name: str,
        *arguments: str,
        domain: int,
        cwd: Path,
        wrapper: Sequence[str] = (),
        fresh: bool = False,
        **options: Any,
    ) -> None:
        code = f'import sys; from klann_ros.executables import {name}; sys.exit({name}())'
        self.name = name
        self._errors = (cwd / f'{name}.{time.monotonic_ns()}.err').open('w+')
        environment = {
            **os.environ,
            'PYTHONPATH': os.pathsep.join([PACKAGE, os.environ.get('PYTHONPATH', '')]),
            'ROS_DOMAIN_ID': str(domain),
            'ROS_LOG_DIR': str(cwd / 'ros_log'),
        }
        self.segments: set[str] = set()
        self.popen: subprocess.Popen[str] | ForkedProcess
        if not (fresh or wrapper or options):
            self.popen = server().start(
                name, arguments, cwd=cwd, environment=environment, stderr=self._errors.fileno()
            )
            return
        self.popen = subprocess.Popen(
            [*wrapper, sys.executable, '-c', code, *arguments],
            cwd=cwd,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            text=True,
            **options,
        )

    def wait(self) -> int:
        self.output, _ = self.popen.communicate(timeout=PATIENCE)
        return self.popen.returncode

    def stop(self, number: signal.Signals = signal.SIGINT) -> int:
        self.popen.send_signal(number)
        return self.wait()

    def kill(self) -> None:
        """End it as a power cut would, and note its shared memory."""
        self.note_segments(self.popen.pid)
        self.popen.kill()
        self.wait()

    def note_segments(self, pid: int) -> None:
        """Note the shared memory of a process before its abrupt end."""
        maps = Path(f'/proc/{pid}/maps').read_text()
        for name in SEGMENT.findall(maps):
            self.segments |= {name, f'{name}_el'}

    @property
    def errors(self) -> str:
        return Path(self._errors.name).read_text()

    def release(self) -> None:
        self.popen.terminate()
        try:
            self.popen.wait(PATIENCE / 2)
        except subprocess.TimeoutExpired:
            self.popen.kill()
        self.popen.communicate()
        self._errors.close()


class Probe:
    """A node in the test's own process: it publishes, subscribes and calls services."""

    def __init__(self, domain: int) -> None:
        self.context = Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = Node('probe', context=self.context)
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)
        self._neighbours: list[Node] = []
        # Describes the processes after a timeout.
        self.failure_report: Callable[[], str] = str

    def listen(
        self, kind: type, topic: str, qos: QoSProfile | int = 2000, *, raw: bool = False
    ) -> list[Any]:
        """Subscribe; return the list that fills with the messages, or with their bytes."""
        received: list[Any] = []
        self.node.create_subscription(kind, topic, received.append, qos, raw=raw)
        return received

    def publisher(
        self, kind: type, topic: str, *, subscribers: int = 1, reliable: bool = True
    ) -> Any:
        """Return a publisher with this number of subscribers."""
        reliability = ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT
        qos = QoSProfile(depth=2000, reliability=reliability)
        publisher = self.node.create_publisher(kind, topic, qos)
        self.await_subscribers(publisher, subscribers)
        return publisher

    def await_subscribers(self, publisher: Any, subscribers: int = 1) -> None:
        """Wait until the subscribers and a publisher of the probe know each other."""
        self.until(lambda: publisher.get_subscription_count() >= subscribers)
        if subscribers:
            topic, found = publisher.topic_name, self.node.get_subscriptions_info_by_topic
            self._until_known(lambda: found(topic), subscribers)

    def add_node(self, name: str, **options: Any) -> Node:
        """Return another node, whose callbacks run when the probe spins."""
        return self.add(Node, name, **options)

    def add(self, kind: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
        node = kind(*arguments, context=self.context, **options)
        self._executor.add_node(node)
        self._neighbours.append(node)
        return node

    def until(self, condition: Callable[[], Any], patience: float = PATIENCE) -> None:
        end = time.monotonic() + patience
        while not condition():
            assert time.monotonic() < end, f'timeout{self.failure_report()}'
            self._executor.spin_once(timeout_sec=0.02)

    def spin(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self._executor.spin_once(timeout_sec=0.02)

    def await_publishers(self, topic: str, publishers: int = 1) -> None:
        """Wait until a subscribed topic has its publishers, and both sides know each other."""
        resolved = self.node.resolve_topic_name(topic)
        found = self.node.get_publishers_info_by_topic
        self._until_known(lambda: found(resolved), publishers)

    def _until_known(self, found: Callable[[], list[Any]], count: int) -> None:
        """Wait until a topic has its endpoints, and their nodes know those of the probe."""

        def names() -> list[str]:
            # Discovery knows an endpoint before it knows its node.
            nodes = [f'{e.node_namespace.rstrip("/")}/{e.node_name}' for e in found()]
            return [node for node in nodes if '_UNKNOWN_' not in node]

        self.until(lambda: len(names()) >= count)
        for name in sorted(set(names()) - self._own):
            self.await_discovery(name)

    @property
    def _own(self) -> set[str]:
        return {node.get_fully_qualified_name() for node in (self.node, *self._neighbours)}

    def await_discovery(self, name: str) -> None:
        """
        Wait until a node knows all publishers, subscriptions and clients that the probe has.

        A participant announces them in the order of their creation: a node that answers a client
        knows all that was created before it. Counts of endpoints show the probe's knowledge only.
        A node without an answer is given up after SILENT.
        """
        client = self.node.create_client(GetParameters, f'{name}/get_parameters')
        futures: list[Any] = []
        silent = time.monotonic() + SILENT
        again = 0.0

        def is_answered() -> bool:
            nonlocal again
            # An answer is lost if the server has not discovered the client yet.
            if client.service_is_ready() and time.monotonic() >= again:
                futures.append(client.call_async(GetParameters.Request()))
                again = time.monotonic() + 0.5
            answered = any(future.done() for future in futures)
            return answered or time.monotonic() >= silent

        self.until(is_answered)
        self.node.destroy_client(client)

    def call(self, kind: type, service: str, request: Any) -> Any:
        client = self.node.create_client(kind, service)
        self.until(client.service_is_ready)
        self.await_discovery(service.rpartition('/')[0])
        future = client.call_async(request)
        self.until(future.done)
        self.node.destroy_client(client)
        return future.result()

    def set_parameters(self, node: str, values: Mapping[str, Any], *, atomic: bool = False) -> Any:
        """Set parameters of a node, each or all of them; return the (last) result."""
        parameters = [Parameter(name, value=v).to_parameter_msg() for name, v in values.items()]
        kind, service = SetParameters, f'{node}/set_parameters'
        if atomic:
            kind, service = SetParametersAtomically, f'{service}_atomically'
        answer = self.call(kind, service, kind.Request(parameters=parameters))
        return answer.result if atomic else answer.results[-1]

    def close(self) -> None:
        self._executor.shutdown()
        for node in [*self._neighbours, self.node]:
            node.destroy_node()
        self.context.try_shutdown()


class RecorderReports:
    """The diagnostics of a recorder: its own counters of each topic."""

    def __init__(self, probe: Probe) -> None:
        self._probe = probe
        self._arrays: list[DiagnosticArray] = probe.listen(DiagnosticArray, '/diagnostics')

    @property
    def statuses(self) -> list[DiagnosticStatus]:
        """Return the statuses of the recording so far."""
        statuses = (status for array in self._arrays for status in array.status)
        return [status for status in statuses if status.name.endswith(': recording')]

    @property
    def values(self) -> dict[str, str]:
        """Return the last values, by keys such as `/crank_angle received`."""
        return {value.key: value.value for s in self.statuses[-1:] for value in s.values}

    def count(self, key: str) -> int:
        return int(self.values.get(key, 0))

    def until(self, key: str, count: int) -> None:
        self._probe.until(lambda: self.count(key) >= count)

    def until_received(self, counts: Mapping[str, int]) -> None:
        """Wait until it has received the messages of each topic."""
        for topic, count in counts.items():
            self.until(f'{topic} received', count)

    def until_reports(self, reports: int = 1) -> None:
        """Wait for further reports."""
        before = len(self.statuses)
        self._probe.until(lambda: len(self.statuses) >= before + reports)


class Domain:
    """A ROS domain with a probe, and processes that have a fresh Python if `fresh`."""

    def __init__(self, domain: int, folder: Path) -> None:
        self.domain = domain
        self.fresh = False
        self.folder = folder
        self._before = {path.name for path in SHARED_MEMORY.iterdir()}
        self.probe = Probe(domain)
        self.probe.failure_report = self._state
        self._processes: list[Process] = []
        self._others: list[Probe] = []

    def other_node(self) -> Node:
        """Return a node in a context of its own, as another process has."""
        self._others.append(Probe(self.domain))
        return self._others[-1].node

    def start(self, name: str, *arguments: str, **parameters: object) -> Process:
        """
        Start an executable with parameters; arguments may end with some for ROS.

        A recorder reports ten times a second: most tests wait for its counters.
        """
        if name == 'recorder_node' and 'output' in parameters:
            parameters = {'diagnostics_period': 0.1, **parameters}
        given = [word for key, value in parameters.items() for word in ('-p', f'{key}:={value}')]
        ros = ['--ros-args'] if given and '--ros-args' not in arguments else []
        return self.start_by([], name, *arguments, *ros, *given)

    def solver(self, *arguments: str, namespace: str = '', **parameters: object) -> Process:
        """Start a solver with reliable inputs, which loses none on a busy machine."""
        policy = 'subscription.reliability'
        inputs = [f'{namespace}/{topic}' for topic in ('crank_angle', 'crank_state')]
        reliable = {f'qos_overrides.{topic}.{policy}': 'reliable' for topic in inputs}
        return self.start('solver_node', *arguments, **reliable, **parameters)

    def solve(self, *arguments: str, managed: bool = False, **parameters: object) -> Any:
        """Return a solver in this process: its inputs are not lost, however busy the machine."""
        given = [word for key, value in parameters.items() for word in ('-p', f'{key}:={value}')]
        kind = ManagedSolverNode if managed else SolverNode
        solver = self.probe.add(kind, cli_args=['--ros-args', *arguments, *given])
        prepare_sets(solver, 'solver_node')
        return solver

    def start_by(
        self, wrapper: Sequence[str], name: str, *arguments: str, **options: Any
    ) -> Process:
        """Start an executable by another one, or with options of Popen."""
        process = Process(
            name,
            *arguments,
            domain=self.domain,
            cwd=self.folder,
            wrapper=wrapper,
            fresh=self.fresh,
            **options,
        )
        self._processes.append(process)
        return process

    def _state(self) -> str:
        """Return the processes' exit codes and their last output."""
        return ''.join(
            f'\n{process.name} ({process.popen.poll()}): {process.errors[-500:]}'
            for process in self._processes
        )

    def close(self) -> None:
        for process in self._processes:
            process.release()
        for probe in (*self._others, self.probe):
            probe.close()
        # Segments from before belong to others.
        for name in {n for process in self._processes for n in process.segments} - self._before:
            (SHARED_MEMORY / name).unlink(missing_ok=True)


@contextmanager
def open_domain(domain: int, folder: Path) -> Iterator[Domain]:
    made = Domain(domain, folder)
    try:
        yield made
    finally:
        made.close()
