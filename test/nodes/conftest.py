"""Every test of a node has a domain, a context and processes of its own."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from domain import own_domain
import pytest
import rclpy
from rclpy.context import Context
from rclpy.node import Node
from ros_world import World, world


@pytest.fixture
def ros(tmp_path: Path) -> Iterator[World]:
    with own_domain() as domain, world(domain, tmp_path) as made:
        yield made


@pytest.fixture
def own_context(ros: World) -> Iterator[Callable[[], Node]]:
    """Return what makes nodes that are in a context of their own, as another process's are."""
    made: list[Node] = []

    def make() -> Node:
        context = Context()
        rclpy.init(context=context, domain_id=ros.domain)
        made.append(Node('other', context=context))
        return made[-1]

    yield make
    for node in made:
        context = node.context
        node.destroy_node()
        context.try_shutdown()


@pytest.fixture(scope='module')
def create() -> Iterator[Callable[..., Any]]:
    """Return a function that creates nodes in this process, with arguments behind --ros-args."""
    created: list[Node] = []
    context = Context()

    def make(kind: Callable[..., Any], *arguments: str, **options: Any) -> Any:
        cli_args = ['--ros-args', *arguments]
        created.append(kind(context=context, cli_args=cli_args, **options))
        return created[-1]

    with own_domain() as domain:
        context.init(args=[], domain_id=domain)
        yield make
        for node in created:
            node.destroy_node()
        context.try_shutdown()
