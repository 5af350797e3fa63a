"""
Change a sound file in ways that the specification allows, so that it is as sound as before.

Records get unknown fields at their end, and records of private and future kinds stand
between them: in the data, in chunks, in the summary. All lengths, offsets and CRCs are put right.
"""

from dataclasses import dataclass, field
import struct
import zlib

import lz4.frame
from mcap_bytes import records as mcap
import zstandard

PACK = {
    b'': lambda data: data,
    b'lz4': lz4.frame.compress,
    b'zstd': zstandard.compress,
}
UNPACK = {
    b'': lambda data: data,
    b'lz4': lz4.frame.decompress,
    b'zstd': lambda data: zstandard.ZstdDecompressor().decompress(data, max_output_size=2**26),
}
# Unknown fields: random bytes, bytes that look like records, or a record.
_SMALL = (
    lambda _: b'\1\xff\xff',
    lambda chance: bytes(chance.choice([1, 8, 9, 40])),
    lambda chance: b'\5' + struct.pack('<Q', chance.choice([0, 22, 30, 2**30, 2**63])) + bytes(30),
    lambda chance: mcap.message(1, 1, 1, 1, b'none')[: chance.randrange(1, 40)],
    lambda chance: chance.randbytes(chance.choice([0, 1, 3, 9, 40])),
)
_LARGE = (
    lambda _: mcap.chunk(mcap.message(1, 1, 1, 1, b'not a message')),
    lambda chance: bytes(chance.choice([400, 5000])),
    lambda chance: chance.randbytes(chance.choice([200, 3000])),
)
UNKNOWN = (*range(0x10, 0x80), *range(0x80, 0x100))


@dataclass
class Part:
    """A record: its opcode, the content that it has, and where it was [bytes]."""

    opcode: int
    content: bytes
    was: int = -1
    inner: list = field(default_factory=list)

    @property
    def packing(self):
        """Return of a chunk how it is compressed, and where its length of data stands."""
        (size,) = struct.unpack_from('<I', self.content, 28)
        end = 32 + size
        return self.content[32:end], end


class LegalFile:
    """
    A file in parts, to be changed and put together again.

    Parameters
    ----------
    data
        The bytes of a sound file, or of one that was cut off.
    large
        Whether unknown fields may be large enough to contain a chunk.

    """

    def __init__(self, data, *, large=True):
        self._kinds = (*_SMALL, *_LARGE) if large else _SMALL
        self.closed = data.endswith(mcap.MAGIC)
        end = len(data) - len(mcap.MAGIC) if self.closed else len(data)
        parts, until = _parts(data, len(mcap.MAGIC), end)
        self._rest = b'' if self.closed else data[until:]
        ends = [n for n, part in enumerate(parts) if part.opcode == mcap.DATA_END]
        split = ends[0] + 1 if ends else len(parts)
        self.data, self.summary = parts[:split], parts[split:]
        for part in self.data:
            if part.opcode == mcap.CHUNK:
                name, place = part.packing
                (size,) = struct.unpack_from('<Q', part.content, place)
                packed = part.content[slice(place + 8, place + 8 + size)]
                part.inner, _ = _parts(UNPACK[name](packed), 0, None)

    def change(self, chance):
        """Change it in some of the ways, as a random number generator says."""
        inner = [part for chunk in self.data for part in chunk.inner]
        for _ in range(chance.choice([1, 3, 10, 40])):
            if chance.random() < 0.5:
                part = chance.choice(chance.choice([self.data, self.summary, inner]) or self.data)
                if part.opcode not in mcap.FINAL:
                    part.content += self._filling(chance)
            else:
                self._insert(chance)

    def _insert(self, chance):
        chunks = [part.inner for part in self.data if part.opcode == mcap.CHUNK]
        place = chance.choice([self.data, self.summary, *chunks[:2]])
        at = chance.randrange(len(place) + 1)
        if place is self.data:
            # Behind the header, before the end of the data, and not before an index of a chunk.
            at = max(1, min(at, len(place) - self.closed))
            while at < len(place) and place[at].opcode == mcap.MESSAGE_INDEX:
                at += 1
        elif place is self.summary:
            at = min(at, len(place) - 1)
        if at >= 0:
            place.insert(at, Part(chance.choice(UNKNOWN), self._filling(chance)))

    def _filling(self, chance):
        return chance.choice(self._kinds)(chance)

    def joined(self):
        """Return the bytes of the changed file."""
        return _Joining(self).file()


def change_file(path, chance, *, large=True):
    """Change a file in legal ways."""
    parts = LegalFile(path.read_bytes(), large=large)
    parts.change(chance)
    path.write_bytes(parts.joined())


class _Joining:
    """Puts the parts together, with all that says where others are."""

    def __init__(self, parts):
        self._parts = parts
        self._out = bytearray(mcap.MAGIC)
        self._places = {}
        self._chunks = {}
        self._moved = {}

    def file(self):
        for part in self._parts.data:
            self._add(part, self._data_content(part))
        if not self._parts.closed:
            return bytes(self._out) + self._parts._rest
        start = len(self._out)
        *summary, footer = self._parts.summary
        groups = {}
        for part in summary:
            content = self._summary_content(part, groups)
            group = groups.setdefault(part.opcode, [len(self._out), 0])
            group[1] = len(self._out) + 9 + len(content) - group[0]
            self._add(part, content)
        offsets = groups.get(mcap.SUMMARY_OFFSET, [0])[0]
        has_crc = footer.content[-4:] != bytes(4)
        rest = self._out[start:]
        self._out += mcap.footer(rest, start if summary else 0, offsets, with_crc=has_crc)
        return bytes(self._out) + mcap.MAGIC

    def _add(self, part, content):
        record = mcap.record(part.opcode, content)
        if part.was >= 0:
            self._places[part.was] = len(self._out), len(record)
        self._out += record

    def _data_content(self, part):
        if part.opcode == mcap.CHUNK:
            return self._chunk_content(part)
        if part.opcode == mcap.MESSAGE_INDEX:
            size = struct.unpack_from('<I', part.content, 2)[0]
            rows = struct.iter_unpack('<QQ', part.content[slice(6, 6 + size)])
            moved = b''.join(struct.pack('<QQ', time, self._moved[at]) for time, at in rows)
            end = 6 + size
            return part.content[:6] + moved + part.content[end:]
        if part.opcode == mcap.DATA_END and part.content != bytes(4):
            return struct.pack('<I', zlib.crc32(self._out))
        return part.content

    def _chunk_content(self, part):
        self._moved, inner = {}, bytearray()
        for item in part.inner:
            self._moved[item.was] = len(inner)
            inner += mcap.record(item.opcode, item.content)
        name, place = part.packing
        (old,) = struct.unpack_from('<Q', part.content, place)
        packed = PACK[name](bytes(inner))
        self._chunks[part.was] = len(packed), len(inner)
        crc = zlib.crc32(inner) if any(part.content[24:28]) else 0
        head = part.content[:16] + struct.pack('<QI', len(inner), crc) + part.content[28:place]
        end = place + 8 + old
        return head + struct.pack('<Q', len(packed)) + packed + part.content[end:]

    def _summary_content(self, part, groups):
        content = part.content
        if part.opcode == mcap.CHUNK_INDEX:
            return self._chunk_index(content)
        if part.opcode in (mcap.ATTACHMENT_INDEX, mcap.METADATA_INDEX):
            (was,) = struct.unpack_from('<Q', content)
            return struct.pack('<QQ', *self._places[was]) + content[16:]
        if part.opcode == mcap.SUMMARY_OFFSET:
            # Some writers name a group that has no records.
            group = groups.get(content[0], (len(self._out), 0))
            return content[:1] + struct.pack('<QQ', *group) + content[17:]
        return content

    def _chunk_index(self, content):
        (was, _, size) = struct.unpack_from('<QQI', content, 16)
        rows = list(struct.iter_unpack('<HQ', content[slice(36, 36 + size)]))
        places = [self._places[at] for _, at in rows]
        offsets = [(number, at) for (number, _), (at, _) in zip(rows, places, strict=True)]
        new = b''.join(struct.pack('<HQ', *row) for row in offsets)
        place = 36 + size
        length = struct.pack('<Q', sum(length for _, length in places))
        (name,) = struct.unpack_from('<I', content, place + 8)
        end = place + 12 + name
        sizes, rest = struct.pack('<QQ', *self._chunks[was]), end + 16
        head = content[:16] + struct.pack('<QQI', *self._places[was], size) + new + length
        return head + content[slice(place + 8, end)] + sizes + content[rest:]


def _parts(data, start, end):
    """Return the records between two offsets, and where the last one that is whole ends."""
    parts, end = [], len(data) if end is None else end
    while start + 9 <= end:
        opcode, length = struct.unpack_from('<BQ', data, start)
        if start + 9 + length > end:
            break
        parts.append(Part(opcode, bytes(data[slice(start + 9, start + 9 + length)]), start))
        start += 9 + length
    return parts, start
