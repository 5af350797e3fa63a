"""The law of cost: work in proportion to the bytes of a file and the messages in it."""

import random

from klann_ros.log.errors import NotALogError
from klann_ros.log.reader import open_log
from mcap_bytes.hostile import HEADER, packed_chunk
from mcap_bytes.records import record
from work import Work

# Calls for a byte of the file, for one that is unpacked, for a message, and at all.
EACH, UNPACKED, MESSAGE, ONCE = 30, 3, 30, 60_000
_OPCODES = (*range(17), 6, 6, 12, 128, 255)
_SIZE = 4000


def check_cost(_, seed, place):
    """Read a file of a pattern that is made by a seed, again and again."""
    chance = random.Random(seed)  # noqa: S311 - no secret
    data = _repeated(b''.join(_part(chance) for _ in range(chance.randrange(1, 5))), chance)
    unpacked = 0
    if chance.random() < 0.4:
        chunk, count = packed_chunk(data, crc=chance.choice([None, 0, 1])), chance.randrange(1, 9)
        data, unpacked = chunk * count, len(data) * count
    place.mkdir()
    path = place / 'x.mcap'
    path.write_bytes(HEADER + data)
    with Work() as done:
        found = _read(path)
    allowed = EACH * len(data) + UNPACKED * unpacked + MESSAGE * found + ONCE
    path.unlink()
    place.rmdir()
    assert done.calls <= allowed, f'seed {seed}: {done.calls} calls, {allowed} are allowed'


def _read(path):
    try:
        with open_log(path) as log:
            return sum(1 for _ in log.messages()) + sum(map(len, log.blocks()))
    except NotALogError:
        return 0


def _part(chance):
    """Return a record, or the head of one that claims what it likes, or some bytes."""
    kind = chance.randrange(4)
    content = bytes(chance.choice([0, 0, 1]) * n for n in range(chance.choice([0, 4, 8, 22, 50])))
    if kind == 0:
        return record(chance.choice(_OPCODES), content)
    if kind == 1:
        length = chance.choice([0, 1, 40, 200, 2000, _SIZE, 3 * _SIZE, 2**40])
        return bytes([chance.choice(_OPCODES)]) + length.to_bytes(8, 'little') + content
    if kind == 2:
        return chance.randbytes(chance.randrange(1, 12))
    return bytes(chance.randrange(1, 12))


def _repeated(pattern, chance):
    return pattern * (chance.choice([_SIZE, 3 * _SIZE]) // len(pattern))
