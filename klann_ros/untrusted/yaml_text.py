"""YAML as users mean it: no anchors, no key twice, 1e-3 a number, one line for a mistake."""

from collections.abc import Callable, Hashable
from math import isfinite
import re
from typing import Any

import yaml

# No file that is meant is deeper, or longer.
DEEPEST = 20
LONGEST = 1_000_000
# Values with a tag of their own, such as !!int, raise whatever comes of them.
_LOADER_ERRORS = (
    yaml.YAMLError,
    ArithmeticError,
    AttributeError,
    LookupError,
    TypeError,
    ValueError,
)


class PlainLoader(yaml.SafeLoader):
    """
    A SafeLoader to which a number to the base of 60 is a text, as to YAML 1.2 and everybody else.

    To YAML 1.1 1:30 is 90, and as long a number as one likes: it takes the square of its length.
    """


def _plain(construct: Callable[[PlainLoader, yaml.ScalarNode], Any]) -> Callable[..., Any]:
    def number(loader: PlainLoader, node: yaml.ScalarNode) -> Any:
        value = loader.construct_scalar(node)
        return value if ':' in str(value) else construct(loader, node)

    return number


PlainLoader.add_constructor('tag:yaml.org,2002:int', _plain(yaml.SafeLoader.construct_yaml_int))
PlainLoader.add_constructor(
    'tag:yaml.org,2002:float', _plain(yaml.SafeLoader.construct_yaml_float)
)


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
        msg = f'it has {len(text)} characters, more than {LONGEST}'
        raise YamlError(msg)
    try:
        content = yaml.load(text, Loader=_Loader)  # noqa: S506 - it is a SafeLoader
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        place = f'line {mark.line + 1}, column {mark.column + 1}: ' if mark else ''
        msg = f'{place}{error.problem or error.context}'
        raise YamlError(msg) from error
    except _LOADER_ERRORS as error:
        reason = ' '.join(str(error).split())[:200]
        msg = f'it holds a value that cannot be read: {reason}'
        raise YamlError(msg) from error
    _check_finite(content, '')
    return content


class _Loader(PlainLoader):
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
_Loader.add_implicit_resolver(
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
        msg = f'{place.lstrip(".")}: {content} must be a finite number'
        raise YamlError(msg)
