"""Every test of a node has a domain, a context and processes of its own."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from domain import own_domain
from klann_ros.nodes.crank.node import CrankNode
from klann_ros.nodes.process import ProcessNode
from klann_ros.nodes.recorder.node import RecorderNode
from klann_ros.nodes.solver.node import ManagedSolverNode, SolverNode
import pytest
from rclpy.context import Context
from ros_domain import Domain, open_domain

KINDS: dict[str, Callable[..., Any]] = {
    'solver_node': SolverNode,
    'solver_node --lifecycle': ManagedSolverNode,
    'crank_node': lambda **options: CrankNode(lambda _=0: None, **options),
    'recorder_node': lambda **options: RecorderNode(lambda _=0: None, **options),
}


@pytest.fixture
def ros(tmp_path: Path) -> Iterator[Domain]:
    with own_domain() as domain, open_domain(domain, tmp_path) as ros:
        yield ros


@pytest.fixture(scope='module')
def module_ros(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Domain]:
    """Open a domain for all tests of a module."""
    with own_domain() as domain, open_domain(domain, tmp_path_factory.mktemp('module')) as ros:
        yield ros


@pytest.fixture(scope='module')
def local_context() -> Iterator[Context]:
    context = Context()
    with own_domain() as domain:
        context.init(args=[], domain_id=domain)
        yield context
        context.try_shutdown()


@pytest.fixture
def create(local_context: Context, tmp_path: Path) -> Iterator[Callable[..., Any]]:
    created: list[Any] = []

    def make(name: str, *arguments: str) -> Any:
        output = ['-p', f'output:={tmp_path / "run"}'] if name == 'recorder_node' else []
        cli_args = ['--ros-args', *output, *arguments]
        created.append(KINDS[name](context=local_context, cli_args=cli_args))
        return created[-1]

    yield make
    for node in created:
        if isinstance(node, ProcessNode):
            node.close()
        node.destroy_node()
