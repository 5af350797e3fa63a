"""
The fields of message types, by the definitions of ROS: ``ros2msg`` and ``ros2idl``.

A type is recognised by its fields, however its definition spells them: ``Point point`` is
``geometry_msgs/Point point``. Definitions of a log are untrusted: the cost of each is bounded.
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping
import re
from typing import NamedTuple

# ROS's primitive types, their code in struct's notation, and their names in IDL.
CODES = {
    'bool': '?', 'byte': 'B', 'char': 'B', 'int8': 'b', 'uint8': 'B', 'int16': 'h', 'uint16': 'H',
    'int32': 'i', 'uint32': 'I', 'int64': 'q', 'uint64': 'Q', 'float32': 'f', 'float64': 'd',
}  # fmt: skip
_IDL_CODES = {
    'boolean': '?', 'octet': 'B', 'short': 'h', 'unsigned short': 'H', 'long': 'i',
    'unsigned long': 'I', 'long long': 'q', 'unsigned long long': 'Q', 'float': 'f', 'double': 'd',
}  # fmt: skip
TEXT = 'string'
_TEXT_TYPES = {TEXT, 'wstring'}
# Fields of a definition that are looked at, more than any known type has, and their depth.
_MAX_FIELDS = 200
_MAX_DEPTH = 10
_MAX_DEFINITION_SIZE = 256 * 1024  # [characters]


class Field(NamedTuple):
    """A field of a message; the fields of a submessage stand in its place."""

    # The name, with those of the submessages around it: `header.stamp.sec`.
    path: str
    # The code of a number in struct's notation, TEXT, or the type of a sequence's messages.
    kind: str
    # Number of elements; None for a sequence, which has any.
    length: int | None = 1
    # The fields of each message in a sequence or an array.
    members: tuple['Field', ...] = ()


# The fields of each type, as pairs of a type and a name; the key is '' for a definition's own.
Definitions = Mapping[str, list[tuple[str, str]]]


def parse_definition(text: str, encoding: str) -> Definitions:
    """Return the fields of each type in a definition, by its encoding."""
    if len(text) > _MAX_DEFINITION_SIZE:
        raise ValueError(f'a definition of {len(text)} characters')
    return _parse_idl(text) if encoding == 'ros2idl' else _parse_msg(text)


def _parse_msg(text: str) -> Definitions:
    definitions = defaultdict(list)
    type_name = ''
    for line in text.splitlines():
        words = line.partition('#')[0].split()
        if words[:1] == ['MSG:']:
            type_name = _short_name(words[-1])
        elif words and words[0].strip('='):
            # A line of one word is no field: no known type has such a one.
            field_type, name, *default = [*words, ''] if len(words) == 1 else words
            is_constant = '=' in name or (default and default[0].startswith('='))
            if not is_constant:
                definitions[type_name].append((field_type, name))
    return definitions


# The texts, comments and includes of an IDL file.
_IDL_IGNORED = re.compile(r'"(?:[^"\\\n]|\\.)*"?|//[^\n]*|^#[^\n]*', re.MULTILINE)


def _parse_idl(text: str) -> Definitions:
    definitions = defaultdict(list)
    type_name = ''
    lines: dict[str, list[str]] = defaultdict(list)
    for line in text.splitlines():
        if line.startswith('IDL: '):
            # The first part is the type itself, which may have a name or none.
            type_name = _short_name(line[5:].strip()) if ''.join(lines['']) else ''
        elif line.strip('='):
            lines[type_name].append(line)
    for part_name, part in lines.items():
        statements = re.split('[;{}]', _IDL_IGNORED.sub('', '\n'.join(part)))
        definitions[part_name] = _idl_fields(statements)
    return definitions


def _idl_fields(statements: Iterable[str]) -> list[tuple[str, str]]:
    """Return the fields of the struct among the statements of an IDL file."""
    arrays: dict[str, str] = {}
    fields = []
    is_struct = False
    for statement in statements:
        # Annotations stand before the type.
        words = [word for word in statement.rpartition(')')[2].split() if word[0] != '@']
        if words[:1] == ['typedef']:
            array_name, _, size = words[-1].partition('[')
            arrays[array_name] = f'{" ".join(words[1:-1])}[{size}'
        elif words[:1] == ['struct']:
            is_struct = True
        elif is_struct and not words:
            break
        elif is_struct:
            *type_words, name = words
            fields.append((_msg_type(' '.join(type_words), arrays), name))
    return fields


def _msg_type(idl_type: str, arrays: Mapping[str, str]) -> str:
    """Return a type of IDL as a .msg file writes it."""
    base, bracket, size = arrays.get(idl_type, idl_type).partition('[')
    if base.startswith('sequence'):
        base = base.removeprefix('sequence').strip('<> ').partition(',')[0]
        bracket, size = '[', ']'
    return _short_name(base.strip().replace('::', '/')) + bracket + size


def _short_name(type_name: str) -> str:
    return type_name.replace('/msg/', '/')


def expand_fields(type_name: str, definitions: Definitions, known: Definitions) -> Iterator[Field]:
    """
    Yield the fields of a type; its submessages' definitions are among the others, or known.

    A ValueError refuses a type that is undefined, or has too many fields.
    """
    expansion = _Expansion({**known, **definitions})
    yield from expansion.fields('' if '' in definitions else type_name, type_name, '', 0)


class _Expansion:
    """Expands the fields of one type, at bounded cost."""

    def __init__(self, definitions: Definitions) -> None:
        self._definitions = definitions
        self._count = 0

    def fields(self, key: str, type_name: str, prefix: str, depth: int) -> Iterator[Field]:
        """Yield the fields of a type with the fields of its inner types, their paths prefixed."""
        package = type_name.partition('/')[0]
        for field_type, name in self._definitions[key]:
            self._count += 1
            if self._count > _MAX_FIELDS or depth > _MAX_DEPTH:
                raise ValueError(f'{type_name} has too many fields')
            bounded_type, bracket, size = field_type.partition('[')
            # The bytes do not show the bound of a text.
            base = bounded_type.partition('<')[0]
            count = _element_count(size) if bracket else 1
            path = f'{prefix}{name}'
            code = CODES.get(base) or _IDL_CODES.get(base)
            if code or base in _TEXT_TYPES:
                yield Field(path, code or TEXT, count)
                continue
            inner = self._resolve(base, package)
            if count == 1 and not bracket:
                yield from self.fields(inner, inner, f'{path}.', depth + 1)
            else:
                members = tuple(self.fields(inner, inner, '', depth + 1))
                yield Field(path, inner, count, members)

    def _resolve(self, name: str, package: str) -> str:
        # The header is the only type that definitions of ROS 1 name without its package.
        for candidate in (_short_name(name), f'{package}/{name}', f'std_msgs/{name}'):
            if candidate in self._definitions:
                return candidate
        raise ValueError(f'{name} is not defined')


def _element_count(size: str) -> int | None:
    """Return the number of elements in `SIZE]`; None for a sequence, with a bound or without."""
    digits = size.removesuffix(']')
    return int(digits[:9]) if digits.isdecimal() else None
