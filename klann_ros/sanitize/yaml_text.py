"""
Safe reading and writing of YAML, at a cost proportional to the text's length.

:func:`parse` reads users' files for this package: no anchors, no duplicate keys, 1e-3 is a number.
:func:`load` reads texts of other tools, with anchors. Invalid text is refused in one line.
"""

from collections.abc import Callable, Hashable, Mapping
from contextlib import suppress
from copy import deepcopy
from math import isfinite
import re
import sys
from typing import Any, TypeVar

import yaml

from .files import AnyPath, read_regular
from .text import printable, printable_line

ContentT = TypeVar('ContentT')

MAX_NESTING = 20
"""Maximum nesting of a user's file."""

MAX_FILE_SIZE = 1_000_000
"""Maximum size of a user's file [bytes]."""

MAX_LOG_TEXT = 4 * 1024 * 1024
"""Maximum size of another tool's text [bytes]; a thousand topics have half of that."""

# Maximum number of nodes, each counted as often as it is referenced: a node takes about 1 KB.
_MAX_WEIGHT = 100_000
_CHARACTERS_A_NODE = 100

# Errors of PyYAML's safe loader beside its own: for `!!int x`, `!!timestamp x`, `!!bool x`,
# `!!set 1` and a thousand opening brackets.
_LOADER_ERRORS = (
    yaml.YAMLError,
    ArithmeticError,
    AttributeError,
    LookupError,
    RecursionError,
    TypeError,
    ValueError,
)
# libyaml's takes a tenth of the time; a PyYAML built without it has none.
_FastDumper: Any = type('_FastDumper', (getattr(yaml, 'CSafeDumper', yaml.SafeDumper),), {})
_PlainDumper: Any = type('_PlainDumper', (yaml.SafeDumper,), {})


def _block_text(dumper: Any, text: str) -> Any:
    """Return the node of a text, one of several lines as a literal block where YAML allows it."""
    style = '|' if '\n' in text.strip('\n') else None
    return dumper.represent_scalar('tag:yaml.org,2002:str', text, style=style)


def _row_of_numbers(dumper: Any, items: list[Any]) -> Any:
    """Return the node of a list, one of numbers on one line."""
    is_row = all(isinstance(item, int | float) for item in items)
    return dumper.represent_sequence('tag:yaml.org,2002:seq', items, flow_style=is_row or None)


for _dumper in (_FastDumper, _PlainDumper):
    _dumper.add_representer(str, _block_text)
    _dumper.add_representer(list, _row_of_numbers)


class YamlError(ValueError):
    """Invalid YAML, or YAML with a refused feature."""


def parse(text: str) -> Any:
    """
    Return the content of a user's YAML text; a YamlError for an invalid one.

    Anchors and aliases, duplicate keys, control characters, numbers that are not finite, and more
    than MAX_FILE_SIZE characters, 100,000 entries or MAX_NESTING levels are refused.
    """
    if not isinstance(text, str):
        raise YamlError(f'it must be text, not {type(text).__name__}')
    if len(text) > MAX_FILE_SIZE:
        raise YamlError(f'it has {len(text)} characters, more than {MAX_FILE_SIZE}')
    try:
        documents = [*yaml.load_all(text, Loader=_UserLoader)]
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = f'line {mark.line + 1}, column {mark.column + 1}: ' if mark else ''
        raise YamlError(f'{place}{error.problem or error.context}') from error
    except _LOADER_ERRORS as error:
        reason = ' '.join(str(error).split())[:200]
        raise YamlError(f'it holds a value that cannot be read: {reason}') from error
    # `ros2 topic echo` ends a text with ---, which begins an empty document.
    content, *others = documents or [None]
    if any(document is not None for document in others):
        raise YamlError(f'it holds {len(documents)} documents, separated by ---, instead of one')
    _check_finite(content, '')
    return content


def parse_file(path: AnyPath) -> Any:
    """Return the content of a user's YAML file; errors as `read_regular` and `parse`."""
    return parse(read_regular(path, MAX_FILE_SIZE))


def content_of_file(
    path: AnyPath, convert: Callable[[Any], ContentT], noun: str, error_type: type[Exception]
) -> ContentT:
    """
    Return the converted content of a user's YAML file.

    An unreadable or invalid file is an error of `error_type` in one line, which says that the file
    holds no `noun`, such as 'motor', and why; `convert` raises a ValueError.
    """
    file = printable(str(path))
    try:
        return convert(parse_file(path))
    except OSError as error:
        raise error_type(f'{file} cannot be read: {error.strerror}') from error
    except (ValueError, TypeError) as error:
        raise error_type(f'{file} holds no {noun}: {printable_line(error)}') from error


def load(text: str) -> Any:
    """Return the data of another tool's YAML text; a ValueError if invalid, or far too large."""
    if len(text) > MAX_LOG_TEXT:
        raise ValueError(f'it is longer than {MAX_LOG_TEXT} bytes')
    try:
        return yaml.load(text, _WeighingLoader)  # noqa: S506 - derived from the safe one
    except _LOADER_ERRORS as error:
        raise YamlError(f'not YAML: {printable_line(error)}') from None


def dump(data: object, *, flow_style: bool | None = False) -> str:
    """Return data as YAML, keys in their own order, without a final newline; None: short rows."""
    options: Any = {'sort_keys': False, 'allow_unicode': True, 'width': 10**6}
    options['default_flow_style'] = flow_style
    try:
        text: str = yaml.dump(data, Dumper=_FastDumper, **options)
    except UnicodeEncodeError:
        # A lone surrogate: libyaml refuses it, PyYAML escapes it.
        text = yaml.dump(data, Dumper=_PlainDumper, **options)
    return text.rstrip('\n')


def with_values(tree: Any, values: Mapping[str, Any]) -> Any:
    """Return a tree of mappings and lists with values in the places of their names."""
    if isinstance(tree, Mapping):
        return {key: with_values(branch, values) for key, branch in tree.items()}
    if isinstance(tree, list):
        return [with_values(branch, values) for branch in tree]
    # A copy: YAML would write an alias of a list that appears twice, which ROS does not read.
    return deepcopy(values.get(tree, tree))


def parameter_file(sections: Mapping[str, Mapping[str, Any]]) -> str:
    """Return a ROS 2 parameter file: the parameters of each node, or of all nodes as '/**'."""
    content = {node: {'ros__parameters': dict(sections[node])} for node in sections}
    return f'{dump(content)}\n'


class _PlainLoader(yaml.SafeLoader):
    """
    A SafeLoader that reads sexagesimal numbers as texts, as YAML 1.2 does.

    In YAML 1.1 1:30 is 90, and a long such number takes time quadratic in its length. A whole
    number beyond all floats is refused: hardly a function of the math module takes it.
    """

    def construct_yaml_int(self, node: yaml.ScalarNode) -> Any:
        if ':' in node.value:
            return node.value
        # A LookupError for an empty text, a ValueError for more digits than Python converts.
        with suppress(LookupError, ValueError):
            number = super().construct_yaml_int(node)
            if abs(number) <= sys.float_info.max:
                return number
        problem = f'{printable(node.value, 20)} is no whole number within +-1.8e308'
        raise yaml.MarkedYAMLError(problem=problem, problem_mark=node.start_mark)

    def construct_yaml_float(self, node: yaml.ScalarNode) -> Any:
        return node.value if ':' in node.value else super().construct_yaml_float(node)


for _kind in ('int', 'float'):
    _construct = getattr(_PlainLoader, f'construct_yaml_{_kind}')
    _PlainLoader.add_constructor(f'tag:yaml.org,2002:{_kind}', _construct)


class _WeighingLoader(_PlainLoader):
    """A loader that counts nodes as often as they are referenced: aliases may nest."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self._weight = 0
        self._weights: dict[yaml.Node, int] = {}

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        start_weight = self._weight
        node = super().compose_node(parent, index)
        if node is None:
            return None
        if node in self._weights:
            self._weight += self._weights[node]
        else:
            size = len(node.value) if isinstance(node, yaml.ScalarNode) else 0
            self._weight += 1 + size // _CHARACTERS_A_NODE
            self._weights[node] = self._weight - start_weight
        if self._weight > _MAX_WEIGHT:
            problem = f'it unfolds to more than {_MAX_WEIGHT} entries'
            raise yaml.MarkedYAMLError(problem=problem, problem_mark=node.start_mark)
        return node


class _UserLoader(_WeighingLoader):
    """A loader that refuses anchors, duplicate keys, and control characters behind escapes."""

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self._depth = 0

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        event = self.peek_event()  # type: ignore[no-untyped-call]  # as PyYAML's stubs have it
        if isinstance(event, yaml.AliasEvent) or getattr(event, 'anchor', None) is not None:
            problem = 'anchors and aliases are not taken: write it out'
            raise yaml.MarkedYAMLError(problem=problem, problem_mark=event.start_mark)
        self._depth += 1
        if self._depth > MAX_NESTING:
            problem = f'more than {MAX_NESTING} levels'
            raise yaml.MarkedYAMLError(problem=problem, problem_mark=event.start_mark)
        node = super().compose_node(parent, index)
        self._depth -= 1
        return node

    def construct_scalar(self, node: yaml.ScalarNode | yaml.MappingNode) -> Any:
        text = super().construct_scalar(node)
        if character := self.NON_PRINTABLE.search(text):
            problem = f'{printable(character[0])} is a character that YAML does not allow'
            raise yaml.MarkedYAMLError(problem=problem, problem_mark=node.start_mark)
        return text

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, Any]:
        keys = set()
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode):
                continue
            if key.value in keys:
                problem = f'{key.value} is there twice'
                raise yaml.MarkedYAMLError(problem=problem, problem_mark=key.start_mark)
            keys.add(key.value)
        return super().construct_mapping(node, deep)


# YAML 1.1 requires a dot and a sign, as in 1.0e-3.
_UserLoader.add_implicit_resolver(
    'tag:yaml.org,2002:float',
    re.compile(r'^[-+]?\d+(?:\.\d*)?[eE][-+]?\d+$'),
    list('-+0123456789'),
)


def _check_finite(content: Any, place: str) -> None:
    if isinstance(content, dict):
        for key, branch in content.items():
            _check_finite(branch, f'{place}.{key}')
    elif isinstance(content, list):
        for i, branch in enumerate(content):
            _check_finite(branch, f'{place}[{i}]')
    elif isinstance(content, float) and not isfinite(content):
        raise YamlError(f'{place.lstrip(".")}: {content} must be a finite number')
