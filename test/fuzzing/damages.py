"""What happens to files: cut, flipped, zeroed, overwritten, pieces missing, twice, or swapped."""

import struct

import yaml

PAGE = 4096


def _cut(data, chance):
    start = chance.randrange(len(data))
    del data[start:]


def _flip(data, chance):
    for _ in range(chance.choice([1, 1, 1, 2, 5, 50])):
        data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)


def _zero_tail(data, chance):
    start = chance.randrange(len(data))
    data[start:] = bytes(len(data) - start)


def _replace(fill):
    """Return a damage that replaces a region by as many bytes or others."""

    def replace(data, chance):
        start, end = _region(data, chance)
        data[start:end] = fill(chance, end - start)

    return replace


def _insert(data, chance):
    position = chance.randrange(len(data))
    data[position:position] = chance.randbytes(chance.randrange(1, 300))


def _duplicate(data, chance):
    start, end = _region(data, chance)
    position = chance.randrange(len(data))
    data[position:position] = data[start:end]


def _swap(data, chance):
    size = chance.randrange(1, 2000)
    if len(data) < 4 * size:
        return
    first = chance.randrange(8, len(data) - 2 * size)
    second = chance.randrange(first + size, len(data) - size + 1)
    span_a = slice(first, first + size)
    span_b = slice(second, second + size)
    data[span_a], data[span_b] = data[span_b], data[span_a]


def _in_record(change):
    """Return a damage at the start of one of the records."""

    def damage_record(data, chance):
        start = _record(data, chance)
        if start is not None:
            change(data, start, chance)

    return damage_record


def _wrong_length(data, start, chance):
    wrong = chance.choice([0, 1, 2**20, 2**40, 2**63, 2**64 - 1, chance.randrange(5000)])
    struct.pack_into('<Q', data, start + 1, wrong)


def _wrong_opcode(data, start, chance):
    data[start] = chance.choice([*range(17), 128, 255])


def _wrong_head(data, start, chance):
    # The record's inner lengths are there.
    position = min(start + chance.randrange(70), len(data) - 1)
    data[position] = chance.randrange(256)


def _overwrite_page(data, chance):
    start = _page(data, chance)
    end = min(start + PAGE, len(data))
    data[start:end] = chance.randbytes(end - start)


def _copy_page(data, chance):
    source, target = _page(data, chance), _page(data, chance)
    end = source + PAGE
    content = data[source:end]
    end = target + len(content)
    data[target:end] = content


def _wrong_in_page(data, chance):
    """Overwrite bytes in the head of a page of SQLite: its type, cell count and pointers."""
    start = _page(data, chance)
    for _ in range(chance.randrange(1, 6)):
        position = min(start + chance.randrange(120), len(data) - 1)
        data[position] = chance.choice([0, 1, 2, 5, 10, 13, 127, 128, 255])


def _page(data, chance):
    return chance.randrange(-(-len(data) // PAGE)) * PAGE


# Each damage, and whether it can take messages away without a trace of them.
DAMAGES = {
    'cut': (_cut, True),
    'flip': (_flip, False),
    'zero tail': (_zero_tail, False),
    'zero': (_replace(lambda _, size: bytes(size)), False),
    'overwrite': (_replace(lambda chance, size: chance.randbytes(size)), False),
    'remove': (_replace(lambda *_: b''), True),
    'insert': (_insert, False),
    'duplicate': (_duplicate, True),
    'swap': (_swap, True),
    'wrong length': (_in_record(_wrong_length), False),
    'wrong opcode': (_in_record(_wrong_opcode), False),
    'wrong head': (_in_record(_wrong_head), False),
    'overwrite page': (_overwrite_page, True),
    'copy page': (_copy_page, True),
    'wrong in page': (_wrong_in_page, True),
}


def damage(path, chance):
    """Damage a file; return what was done, and whether it can go without a trace."""
    data = bytearray(path.read_bytes())
    done = chance.choices([*DAMAGES], k=chance.choice([1, 1, 1, 2, 3]))
    for name in done:
        if len(data) > 100:
            DAMAGES[name][0](data, chance)
    path.write_bytes(data)
    return done, any(DAMAGES[name][1] for name in done)


def damage_metadata(folder, chance):
    """Take metadata.yaml away, garble it, or let it name other files; return what was done."""
    path = folder / 'metadata.yaml'
    done = chance.choice(['missing', 'cut', 'flipped', 'bytes', 'other', 'odd'])
    data = bytearray(path.read_bytes() if path.exists() else b'a: 1\n')
    if done == 'missing':
        path.unlink(missing_ok=True)
        return done
    if done == 'cut':
        start = chance.randrange(len(data))
        del data[start:]
    elif done == 'flipped':
        data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
    elif done == 'bytes':
        data = bytearray(chance.randbytes(200))
    else:
        names = {
            'other': ['gone_7.mcap', *(path.name for path in folder.glob('*_0.mcap'))],
            'odd': [None, 3, ['a'], '/etc/passwd', '', '..', '.', 'x\0y'],
        }[done]
        metadata = {'rosbag2_bagfile_information': {'relative_file_paths': names}}
        data = yaml.safe_dump(metadata).encode()
    path.write_bytes(data)
    return done


def _region(data, chance):
    start = chance.randrange(len(data))
    return start, min(len(data), start + chance.choice([1, 9, 40, 300, 2000, 9000]))


def _record(data, chance):
    """Return where one of the records starts, as far as they can be followed."""
    starts, offset = [], 8
    while offset + 9 <= len(data):
        starts.append(offset)
        offset += 9 + struct.unpack_from('<Q', data, offset + 1)[0]
    return chance.choice(starts) if starts else None
