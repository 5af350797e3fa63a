"""YAML in and out, so that a hostile text is one kind of error and output is always plain."""

from typing import Any

from klann_ros.untrusted.text import printable_line
from klann_ros.untrusted.yaml_text import PlainLoader
import yaml

MAX_SIZE = 4 * 1024 * 1024
"""A longer text is refused [bytes]; a bag of a thousand topics has metadata of half of that."""

# What all nodes may weigh, each as often as it is referred to: a node takes about 1 KB.
_MAX_WEIGHT = 100_000
_CHARACTERS_A_NODE = 100

# What PyYAML's safe loader raises beside its own errors: on `!!int x`, `!!timestamp x`,
# `!!bool x`, `!!set 1` and on a thousand opening brackets.
_LOADER_ERRORS = (
    yaml.YAMLError,
    ArithmeticError,
    AttributeError,
    LookupError,
    RecursionError,
    TypeError,
    ValueError,
)


def load(text: str) -> Any:
    """
    Return the data of a YAML text.

    Raises
    ------
    ValueError
        The text is not YAML, or unfolds to too much; the message is one line.

    """
    if len(text) > MAX_SIZE:
        raise ValueError(f'it is longer than {MAX_SIZE} bytes')
    try:
        return yaml.load(text, _WeighingLoader)  # noqa: S506 - derived from the safe one
    except _LOADER_ERRORS as error:
        raise ValueError(f'not YAML: {printable_line(error)}') from None


def dump(data: object) -> str:
    """Return data as YAML in block style, keys in their own order, without a final newline."""
    text: str = yaml.safe_dump(data, sort_keys=False, allow_unicode=True, width=10**6)
    return text.rstrip('\n')


class _WeighingLoader(PlainLoader):
    """
    The plain loader, for texts that may unfold without end.

    An anchor that is referred to twice, in an anchor that is referred to twice, and so on, is some
    lines of text and gigabytes of data, when they are merged or told in a message.
    """

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self._weight = 0
        self._weights: dict[yaml.Node, int] = {}

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        """Compose a node, unless all that was met so far is too much."""
        before = self._weight
        node = super().compose_node(parent, index)
        if node is None:
            return None
        if node in self._weights:
            self._weight += self._weights[node]
        else:
            size = len(node.value) if isinstance(node, yaml.ScalarNode) else 0
            self._weight += 1 + size // _CHARACTERS_A_NODE
            self._weights[node] = self._weight - before
        if self._weight > _MAX_WEIGHT:
            raise yaml.YAMLError(f'it unfolds to more than {_MAX_WEIGHT} entries')
        return node
