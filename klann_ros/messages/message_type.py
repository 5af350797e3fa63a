"""
A message type: reads a message, finds its numbers, writes a message, and fills a template.

A type is recognised by its fields, however its definition spells them, ``ros2msg`` or ``ros2idl``:
``Point point`` is ``geometry_msgs/Point point``. Definitions of a log are untrusted: the cost of
each is bounded.
"""

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
import re
import struct
from typing import Any, NamedTuple

from .cdr import CdrCursor, CdrWriter, HEADER_SIZE, STAMP_SIZE

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


class _Expansion:
    """
    Expands the fields of one type, at bounded cost.

    The type itself may be called ''. A ValueError refuses one that uses an undefined type, or has
    too many fields.
    """

    def __init__(self, type_name: str, definitions: Definitions) -> None:
        self._definitions = {type_name: [], **definitions}
        if '' in definitions:
            self._definitions[type_name] = definitions['']
        self._count = 0
        self.fields = tuple(self._expand(type_name, '', 0))

    def _expand(self, type_name: str, prefix: str, depth: int) -> Iterator[Field]:
        """Yield the fields of a type with the fields of its inner types, their paths prefixed."""
        package = type_name.partition('/')[0]
        for field_type, name in self._definitions[type_name]:
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
                yield from self._expand(inner, f'{path}.', depth + 1)
            else:
                members = tuple(self._expand(inner, '', depth + 1))
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


class NumberSpan(NamedTuple):
    """The place of adjacent numbers in a message."""

    begin: int  # offset of the first [bytes]
    length: int
    code: str  # in struct's notation

    @property
    def end(self) -> int:
        """Return the offset behind the last [bytes]."""
        return self.begin + self.length * struct.calcsize(self.code)


class Layout:
    """The places of the numbers in a message, and in all with equal texts and lengths."""

    def __init__(self, data: bytes, fields: Sequence[Field], last: str = '') -> None:
        cursor = CdrCursor(data)
        self.data = data
        self.order = cursor.order
        # Strings and sequences of strings, by the paths of their fields.
        self.texts: dict[str, list[bytes]] = {}
        self.spans: dict[str, NumberSpan] = {}
        self._add_fields(cursor, fields, '', last)
        # The ranges of byte order, lengths and texts [bytes]; the padding between is of any value.
        self.structure = [slice(0, 2), *cursor.structure]

    def span(self, path: str) -> NumberSpan:
        """Return the place of a field's numbers, those of a submessage together."""
        if path in self.spans:
            return self.spans[path]
        inner = [span for name, span in self.spans.items() if name.startswith(f'{path}.')]
        return NumberSpan(inner[0].begin, sum(span.length for span in inner), inner[0].code)

    def _add_fields(
        self, cursor: CdrCursor, fields: Sequence[Field], prefix: str, last: str
    ) -> None:
        for field in fields:
            path = f'{prefix}{field.path}'
            count = cursor.length() if field.length is None else field.length
            if field.members:
                for index in range(count):
                    self._add_fields(cursor, field.members, f'{path}[{index}].', '')
            elif field.kind == TEXT:
                self.texts[path] = [cursor.string() for _ in range(count)]
            else:
                begin = cursor.skip_numbers(field.kind, count)
                self.spans[path] = NumberSpan(begin, count, field.kind)
            if path == last:
                break


class MessageType:
    """A message type with its fields, which recognises, reads and writes its messages."""

    def __init__(self, name: str, definitions: Definitions) -> None:
        # As topics name it: `std_msgs/msg/Float64`.
        self.name = name.replace('/', '/msg/')
        self.fields = _Expansion(name, definitions).fields
        # Whether a message begins with its stamp.
        self.is_stamped = [field.kind for field in self.fields[:2]] == ['i', 'I']
        self._definitions = definitions
        self._short_name = name
        self._is_defined = lru_cache(maxsize=16)(self._has_fields)

    def is_defined_by(self, definition: str, encoding: str) -> bool:
        """
        Return whether an untrusted definition has the fields of this type.

        Without any definition, the name of a topic's type decides.
        """
        if not definition.strip():
            return encoding in ('', 'ros2msg', 'ros2idl')
        return encoding in ('ros2msg', 'ros2idl') and self._is_defined(definition, encoding)

    def _has_fields(self, definition: str, encoding: str) -> bool:
        try:
            definitions = {**self._definitions, **parse_definition(definition, encoding)}
            return _Expansion(self._short_name, definitions).fields == self.fields
        except ValueError:
            return False

    def layout(self, data: bytes, last: str = '') -> Layout:
        """Return the layout of a message, up to a last field; a ValueError for another message."""
        return Layout(data, self.fields, last)

    def read(self, data: bytes) -> dict[str, Any]:
        """
        Return numbers, texts and lists of them by the paths of their fields.

        A submessage of a sequence is such a dictionary. A ValueError refuses another message.
        """
        return _read_fields(CdrCursor(data), self.fields)

    def write(self, content: Mapping[str, Any]) -> bytes:
        """Return a message of numbers, texts and lists of them; what is left out is 0 or empty."""
        writer = CdrWriter()
        _write_fields(writer, self.fields, content)
        return bytes(writer.data)


def _read_fields(cursor: CdrCursor, fields: Sequence[Field]) -> dict[str, Any]:
    content = {}
    for field in fields:
        count = cursor.length() if field.length is None else field.length
        elements: Sequence[Any]
        if field.members:
            elements = [_read_fields(cursor, field.members) for _ in range(count)]
        elif field.kind == TEXT:
            elements = [cursor.string().decode(errors='replace') for _ in range(count)]
        else:
            elements = cursor.numbers(field.kind, count)
        content[field.path] = elements[0] if field.length == 1 else elements
    return content


def _write_fields(writer: CdrWriter, fields: Sequence[Field], content: Mapping[str, Any]) -> None:
    """Write fields in their order; what the content does not have is 0 or empty."""
    for field in fields:
        default: Any = '' if field.kind == TEXT else 0
        elements = content.get(field.path, [default] * (field.length or 0))
        if field.length is None:
            writer.numbers('I', [len(elements)])
        elif field.length == 1 and field.path in content:
            elements = [elements]
        elif len(elements) != field.length:
            size = f'{field.length} elements, not {len(elements)}'
            raise ValueError(f'{field.path} has {size}')
        if field.members:
            for element in elements:
                _write_fields(writer, field.members, element)
        elif field.kind == TEXT:
            for text in elements:
                writer.string(text)
        else:
            writer.numbers(field.kind, elements)


class NumberPlaces:
    """
    The places of some numbers in a message, and in all that differ in their numbers only.

    `paths` are those of the numbers, in the message's order; an element of an array is
    `path[index]`.
    """

    def __init__(self, layout: Layout, paths: Iterable[str]) -> None:
        code = layout.order
        end = 0
        for path in paths:
            span = _span_of(layout, path)
            code += f'{span.begin - end}x{span.length}{span.code}'
            end = span.end
        # Returns the numbers in a message that fits.
        self.read = struct.Struct(code).unpack_from
        self._size = len(layout.data)
        # All bytes but the numbers, with their offsets.
        self._constants = [layout.data[:2]]
        self._offsets = [0]
        end = HEADER_SIZE
        for span in layout.spans.values():
            if span.begin > end:
                self._constants.append(layout.data[slice(end, span.begin)])
                self._offsets.append(end)
            end = span.end

    def fits(self, data: bytes) -> bool:
        """Return whether a message has its numbers in these places."""
        is_like = map(data.startswith, self._constants, self._offsets)
        return len(data) == self._size and all(is_like)


class Template:
    """
    A message of which only the stamp and some numbers change.

    `Publisher.publish` takes the result of `fill`, and a subscriber receives the bytes of the
    published message. Only the padding between fields differs: a typed publish leaves any bytes
    there, a template zeros.

    `numbers` are the paths of the numbers that change, as for `NumberPlaces`. The rest has the
    values of `content`.
    """

    def __init__(
        self, message_type: MessageType, content: Mapping[str, Any], numbers: Sequence[str]
    ) -> None:
        message = message_type.write(content)
        layout = message_type.layout(message)
        stamp = next(iter(layout.spans.values())).begin
        spans = [_span_of(layout, path) for path in numbers]
        # Offset of the first number [bytes].
        self.first_number = spans[0].begin
        # The constant parts: before the stamp, up to the first number, and others that are not 0.
        self._head = message[:stamp]
        self._texts = message[slice(stamp + STAMP_SIZE, self.first_number)]
        self.constants: list[bytes] = []
        code = f'<{stamp}siI{len(self._texts)}s'
        ends = [self.first_number, *(span.end for span in spans)]
        for span, end in zip(spans, ends, strict=False):
            code += self._add_constant(message[slice(end, span.begin)])
            code += f'{span.length}{span.code}'
        code += self._add_constant(message[slice(ends[-1], None)])
        self._pack: Callable[..., bytes] = struct.Struct(code).pack

    def _add_constant(self, constant: bytes) -> str:
        """Return the code of a part in struct's notation."""
        if not constant.strip(b'\0'):
            return f'{len(constant)}x'
        self.constants.append(constant)
        return f'{len(constant)}s'

    def fill(self, sec: int, nanosec: int, *numbers: float | bytes) -> bytes:
        """Return the message; `constants` stand between the numbers, where there are any."""
        return self._pack(self._head, sec, nanosec, self._texts, *numbers)


def _span_of(layout: Layout, path: str) -> NumberSpan:
    """Return the place of a field, or of an element of an array."""
    array, _, index = path.removesuffix(']').rpartition('[')
    if path in layout.spans or not path.endswith(']'):
        return layout.span(path)
    begin, _, code = layout.span(array)
    return NumberSpan(begin + int(index) * struct.calcsize(code), 1, code)
