"""A look at the ROS graph ten times a second that costs an executor nothing while it is still."""

from collections.abc import Callable, Iterable
from contextlib import suppress
from threading import Event, Thread

from rclpy.node import Node, NodeNameNonExistentError

# How often new topics are looked for, and how often without news where something is awaited [s].
PERIOD, PATIENCE = 0.1, 1.0


class GraphWatch:
    """
    Call back in the executor's thread when topics or publishers have appeared.

    A timer would have the executor build its wait set anew each time, which takes fifty times as
    long as to look.

    Parameters
    ----------
    node : rclpy.node.Node
        Who looks.
    silent : callable
        Returns the names of topics whose first publisher is awaited.
    is_due : callable
        Returns whether to call back without news, given whether that is a second since the last.
    on_news : callable
        Is called back.

    """

    def __init__(
        self,
        node: Node,
        silent: Callable[[], Iterable[str]],
        is_due: Callable[[bool], bool],
        on_news: Callable[[], object],
    ) -> None:
        """Begin."""
        self._node, self._silent, self._is_due = node, silent, is_due
        self._stopped = Event()
        self._guard = node.create_guard_condition(on_news)
        self._thread = Thread(target=self._look, name='graph', daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Look no more."""
        self._stopped.set()
        self._thread.join()

    def _look(self) -> None:
        before: object = None
        looks = 0
        while not self._stopped.wait(PERIOD):
            looks += 1
            is_late = looks >= PATIENCE / PERIOD
            now = self._facts()
            if now != before or self._is_due(is_late):
                self._guard.trigger()
                before, looks = now, 0

    def _facts(self) -> object:
        node = self._node
        heard = [(name, node.count_publishers(name)) for name in list(self._silent())]
        return topics_and_types(node), heard


def topics_and_types(node: Node) -> list[tuple[str, list[str]]]:
    """
    Return what is published or heard, and the types of it.

    DDS takes any bytes for a name, and rclpy tells none at all where one is no text. Then the
    nodes are asked one by one, and whose names are no text is left out.
    """
    with suppress(UnicodeDecodeError):
        known: list[tuple[str, list[str]]] = node.get_topic_names_and_types()
        return known
    found: dict[str, set[str]] = {}
    with suppress(UnicodeDecodeError):
        for name, namespace in node.get_node_names_and_namespaces():
            with suppress(UnicodeDecodeError, NodeNameNonExistentError):
                for topic, kinds in node.get_publisher_names_and_types_by_node(name, namespace):
                    found.setdefault(topic, set()).update(kinds)
    return [(topic, sorted(found[topic])) for topic in sorted(found)]
