"""A message type: reads a message, finds its numbers, writes a message, and fills a template."""

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
import struct
from typing import Any, NamedTuple

from .cdr import CdrCursor, CdrWriter, STAMP_SIZE
from .fields import Definitions, expand_fields, Field, parse_definition, TEXT


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

    def __init__(self, name: str, known: Definitions) -> None:
        # As topics name it: `std_msgs/msg/Float64`.
        self.name = name.replace('/', '/msg/')
        self.fields = tuple(expand_fields(name, {}, known))
        # Whether a message begins with its stamp.
        self.is_stamped = [field.kind for field in self.fields[:2]] == ['i', 'I']
        self._known = known
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
            definitions = parse_definition(definition, encoding)
            return tuple(expand_fields(self._short_name, definitions, self._known)) == self.fields
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
        elements = content.get(field.path, [] if field.length is None else default)
        if field.length is None:
            writer.numbers('I', [len(elements)])
        elif field.length == 1:
            elements = [elements]
        if field.members:
            for element in elements:
                _write_fields(writer, field.members, element)
        elif field.kind == TEXT:
            for text in elements:
                writer.string(text)
        else:
            writer.numbers(field.kind, elements or [0] * (field.length or 0))


class Template:
    """
    A message of which only the stamp and some numbers change.

    `Publisher.publish` takes the result of `fill`, and a subscriber receives the bytes of the
    published message. Only the padding between fields differs: a typed publish leaves any bytes
    there, a template zeros.

    `numbers` are the paths of the numbers that change, in the message's order; an element of an
    array is `path[index]`. The rest has the values of `content`.
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
        self._constants: list[bytes] = []
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
        self._constants.append(constant)
        return f'{len(constant)}s'

    def fill(self, sec: int, nanosec: int, *numbers: float) -> bytes:
        """Return the message."""
        return self._pack(self._head, sec, nanosec, self._texts, *numbers)


def _span_of(layout: Layout, path: str) -> NumberSpan:
    """Return the place of a field, or of an element of an array."""
    array, _, index = path.removesuffix(']').rpartition('[')
    if path in layout.spans or not path.endswith(']'):
        return layout.span(path)
    begin, _, code = layout.span(array)
    return NumberSpan(begin + int(index) * struct.calcsize(code), 1, code)
