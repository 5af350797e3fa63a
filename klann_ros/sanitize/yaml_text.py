"""
YAML in and out: whatever a text is, it is read at a cost like its length, or refused in one line.

There are two kinds. :func:`parse` reads what users write for this package, as they mean it: no
anchors, no key twice, 1e-3 a number. :func:`load` reads what other tools write, as they mean it.
"""

from collections.abc import Callable, Hashable
from math import isfinite
import re
from typing import Any

import yaml

from .text import printable_line

# No file of a user that is meant is deeper, or longer.
DEEPEST = 20
LONGEST = 1_000_000

MAX_SIZE = 4 * 1024 * 1024
"""A longer text of a tool is refused [bytes]; metadata of a thousand topics have half of that."""

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


class _PlainLoader(yaml.SafeLoader):
    """
    A SafeLoader to which a number to the base of 60 is a text, as to YAML 1.2 and everybody else.

    To YAML 1.1 1:30 is 90, and as long a number as one likes: it takes the square of its length.
    """


def _plain(construct: Callable[[_PlainLoader, yaml.ScalarNode], Any]) -> Callable[..., Any]:
    def number(loader: _PlainLoader, node: yaml.ScalarNode) -> Any:
        value = loader.construct_scalar(node)
        return value if ':' in str(value) else construct(loader, node)

    return number


_PlainLoader.add_constructor('tag:yaml.org,2002:int', _plain(yaml.SafeLoader.construct_yaml_int))
_PlainLoader.add_constructor(
    'tag:yaml.org,2002:float', _plain(yaml.SafeLoader.construct_yaml_float)
)


# libyaml's takes a tenth of the time; a PyYAML built without it has none.
_FastDumper = getattr(yaml, 'CSafeDumper', yaml.SafeDumper)


class YamlError(ValueError):
    """A text that is no YAML, or none that is taken."""


def parse(text: str) -> Any:
    """
    Return the content of a YAML text.

    Raises
    ------
    YamlError
        It is no YAML, or holds what is not taken: anchors and aliases, a key twice, a number that
        is not finite, more than a million characters or twenty levels.

    """
    if len(text) > LONGEST:
        raise YamlError(f'it has {len(text)} characters, more than {LONGEST}')
    try:
        content = yaml.load(text, Loader=_UserLoader)  # noqa: S506 - it is a SafeLoader
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = f'line {mark.line + 1}, column {mark.column + 1}: ' if mark else ''
        raise YamlError(f'{place}{error.problem or error.context}') from error
    except _LOADER_ERRORS as error:
        reason = ' '.join(str(error).split())[:200]
        raise YamlError(f'it holds a value that cannot be read: {reason}') from error
    _check_finite(content, '')
    return content


class _UserLoader(_PlainLoader):
    """A loader that takes no aliases, which may grow beyond all measure, and no key twice."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self._depth = 0

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        event = self.peek_event()  # type: ignore[no-untyped-call]  # as PyYAML's stubs have it
        if isinstance(event, yaml.AliasEvent) or getattr(event, 'anchor', None) is not None:
            problem = 'anchors and aliases are not taken: write it out'
            raise yaml.MarkedYAMLError(problem=problem, problem_mark=event.start_mark)
        self._depth += 1
        if self._depth > DEEPEST:
            problem = f'more than {DEEPEST} levels'
            raise yaml.MarkedYAMLError(problem=problem, problem_mark=event.start_mark)
        node = super().compose_node(parent, index)
        self._depth -= 1
        return node

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        seen = set()
        scalars = (key for key, _ in node.value if isinstance(key, yaml.ScalarNode))
        for key in scalars:
            if key.value in seen:
                problem = f'{key.value} is there twice'
                raise yaml.MarkedYAMLError(problem=problem, problem_mark=key.start_mark)
            seen.add(key.value)
        return super().construct_mapping(node, deep)


# YAML 1.1 wants a dot and a sign in 1.0e-3; nobody else does.
_UserLoader.add_implicit_resolver(
    'tag:yaml.org,2002:float',
    re.compile(r'^[-+]?\d+(?:\.\d*)?[eE][-+]?\d+$'),
    list('-+0123456789'),
)


def _check_finite(content: Any, place: str) -> None:
    if isinstance(content, dict):
        for key, value in content.items():
            _check_finite(value, f'{place}.{key}')
    elif isinstance(content, list):
        for i, value in enumerate(content):
            _check_finite(value, f'{place}[{i}]')
    elif isinstance(content, float) and not isfinite(content):
        raise YamlError(f'{place.lstrip(".")}: {content} must be a finite number')


def load(text: str) -> Any:
    """
    Return the data of a YAML text.

    A ValueError of one line says that the text is not YAML, or unfolds to too much.
    """
    if len(text) > MAX_SIZE:
        raise ValueError(f'it is longer than {MAX_SIZE} bytes')
    try:
        return yaml.load(text, _WeighingLoader)  # noqa: S506 - derived from the safe one
    except _LOADER_ERRORS as error:
        raise ValueError(f'not YAML: {printable_line(error)}') from None


def dump(data: object) -> str:
    """Return data as YAML in block style, keys in their own order, without a final newline."""
    try:
        text = _dumped(data, _FastDumper)
    except UnicodeEncodeError:
        # Half a pair of surrogates: libyaml takes none, PyYAML escapes it.
        text = _dumped(data, yaml.SafeDumper)
    return text.rstrip('\n')


def _dumped(data: object, dumper: Any) -> str:
    text: str = yaml.dump(data, Dumper=dumper, sort_keys=False, allow_unicode=True, width=10**6)
    return text


class _WeighingLoader(_PlainLoader):
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
