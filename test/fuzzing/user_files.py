"""Files of users and strangers, each hostile in one place: a value, a line, or the file itself."""

import json
import os
import re
import socket

import yaml

LONG_DIGITS = '9' * 5000
# YAML of one value. Those of JSON are read alike by both.
JSON_VALUES = [
    *('0', '-1', '1', '1e-400', '1e308', '-1e308', '1e400', '-1e400', '5e-324', '-0.0', '1e15'),
    *('true', 'null', '""', '"x"', '[]', '{}', '[null]', '{"a": {}}', '[[[[1]]]]', '"1e400"'),
    *(f'1{"0" * 308}', f'1{"0" * 309}', f'-1{"0" * 400}', LONG_DIGITS, f'0.{LONG_DIGITS}'),
    *('"\\u0000"', '"\\ud800"', '"\\u001b[2J"', '"a\\nb"', '"\\u202e"', '"\\ufeff"', '"\\uffff"'),
    *(f'"{"x" * 100_000}"', f'[{"1, " * 3000}1]', f'{"[" * 30}{"]" * 30}', '18446744073709551616'),
    *('"~nosuchuser/x"', '"/dev/zero"', '"/"', '"."', '".."', '"../../etc/passwd"', '"CON"'),
]
YAML_VALUES = [
    *JSON_VALUES,
    *('.nan', '.inf', '-.inf', '~', 'yes', '0x' + 'f' * 6000, '0b1', '0o7', '017', '1:30', '1_0'),
    *('2001-01-01', '2001-01-01 00:00:00', '2001-99-99', '=', '<<', '!!int x', '!!binary AA=='),
    *('!!set {a}', '!!omap [a: 1]', '!!pairs [a: 1]', '!!timestamp x', '!!float x', '!!bool x'),
    *('!!python/object/apply:os.system [x]', '!x y', '&a [*a]', '*a', '&a 1', '"\\x1b"', "'"),
    *('{<<: {a: 1}}', '{a: 1, a: 2}', '{[a]: 1}', '{1: 1, true: 2, null: 3}', '? {a: b}', '|'),
    *('!!null', '!!str', '!!seq x', '!!map x', '[', '{', '"', '- 1', '%', '@', '`', '\t', '\x00'),
]
# Values that pass the checks of types, and reach the computations.
NUMBERS = [
    *(
        '0',
        '0.0',
        '-0.0',
        '1',
        '-1',
        '2',
        '0.5',
        '1e-9',
        '1e-3',
        '1e3',
        '1e6',
        '1e9',
        '1e15',
        '19.9',
    ),
    *(
        '1e-300',
        '5e-324',
        '1e100',
        '1e154',
        '1e300',
        '1e308',
        '-1e308',
        '90',
        '360',
        '6.28',
        '1e-15',
    ),
]
_MARK = 'H0STILE'
CELLS = [
    *('', ' ', 'nan', 'inf', '1e400', '1e308', '-1e308', '1e-400', '1_0', LONG_DIGITS, '0x10'),
    *(
        '=1+1',
        '@x',
        '+1',
        '-',
        ',',
        ';',
        '"',
        '""',
        "'",
        "'=x",
        '\x00',
        '\x1b[2J',
        '\u202e',
        'CON',
    ),
    *(
        '\n',
        '\r',
        '\t',
        'x' * 200_000,
        '١٢',
        '½',
        '1,5',
        '1.234,5',
        'True',
        '\ud7ff',
        '\ufeff',
        '../x',
    ),
]


def hostile_yaml(text, chance):
    """Return a YAML text with a hostile value or key in the place of another."""
    return _with_value(yaml.safe_load(text), yaml.safe_dump, chance, YAML_VALUES)


def hostile_json(text, chance):
    """Return a JSON text with a hostile value or key in the place of another."""
    return _with_value(json.loads(text), json.dumps, chance, JSON_VALUES)


def _with_value(content, dump, chance, values):
    """Return a text of a content in which a hostile value stands for a member or a key."""
    places = [*_places(content)]
    if not places:
        return chance.choice(values)
    branch, key = chance.choice(places)
    numbers = [place for place in places if type(place[0][place[1]]) in {int, float}]
    action = chance.choice(['value', 'number', 'number', 'number', 'key', 'new key', 'missing'])
    if action == 'number' and numbers:
        branch, key = chance.choice(numbers)
        values = NUMBERS
    if action == 'missing':
        del branch[key]
    elif action in {'key', 'new key'} and isinstance(branch, dict):
        branch[_MARK] = branch.pop(key) if action == 'key' else 1
    else:
        branch[key] = _MARK
    return re.sub(f'["\']?{_MARK}["\']?', lambda _: chance.choice(values), dump(content))


def _places(content):
    """Yield the mapping or list, and the key, of each member."""
    keys = [*content] if isinstance(content, dict) else range(len(content))
    for key in keys:
        yield content, key
        if isinstance(content[key], dict | list):
            yield from _places(content[key])


def hostile_table(text, chance):
    """Return a CSV text with a hostile cell in the place of another."""
    lines = text.splitlines()
    row = chance.choice([0, chance.randrange(len(lines))])
    cells = lines[row].split(',')
    cells[chance.randrange(len(cells))] = chance.choice(CELLS)
    lines[row] = ','.join(cells)
    return '\n'.join(lines)


def hostile_text(text, chance):
    """Return a text with a hostile piece in a random place, or in the place of another."""
    start = chance.randrange(len(text) + 1)
    end = start + chance.choice([0, 0, 1, 5, 50])
    piece = chance.choice(
        chance.choice([CELLS, YAML_VALUES, ['<!DOCTYPE x [<!ENTITY a "b">]>', '<path ']])
    )
    return text[:start] + piece * chance.choice([1, 1, 1, 50]) + text[end:]


def _lines(change):
    return lambda text, chance: '\n'.join(change(text.splitlines(), chance))


def _tabs(text, _):
    return text.replace('  ', '\t')


def _two_documents(text, _):
    return f'{text}\n---\n{text}'


def _nested(text, chance):
    opening, closing = chance.choice([('[', ']'), ('{a: ', '}'), ('- ', ''), ('<g>', '</g>')])
    depth = chance.choice([10, 25, 2000, 100_000])
    return opening * depth + text + closing * depth


def _bomb(_, chance):
    count = chance.choice([3, 9])
    levels = [f'a{n}: &a{n} [{", ".join([f"*a{n - 1}"] * 9)}]' for n in range(1, count)]
    return '\n'.join(['a0: &a0 x', *levels])


TEXT_CHANGES = [
    lambda *_: '',
    lambda *_: '\n',
    lambda *_: '---\n...\n',
    lambda text, _: text + '---\n',
    lambda text, chance: text[: chance.randrange(len(text) + 1)],
    lambda text, _: text.replace('\n', '\r\n'),
    lambda text, _: text.replace('\n', '\r'),
    lambda text, _: text + text,
    lambda text, _: '<<: {a: 1}\n' + text,
    lambda text, _: text.replace(' ', '\u00a0'),
    lambda text, _: text.upper(),
    lambda text, _: 'x' * 300_000 + text,
    _lines(lambda lines, chance: chance.sample(lines, len(lines))),
    _lines(lambda lines, _: lines + lines),
    _tabs,
    _two_documents,
    _nested,
    _bomb,
]


def _flipped(text, chance):
    data = bytearray(text.encode())
    for _ in range(chance.choice([1, 1, 5, 50])):
        if data:
            data[chance.randrange(len(data))] = chance.randrange(256)
    return bytes(data)


ENCODINGS = [
    lambda text, _: text.encode('utf-8-sig'),
    lambda text, _: text.encode('utf-16'),
    lambda text, _: text.encode('utf-16-le'),
    lambda text, _: text.encode('utf-32'),
    lambda text, _: ('# é\n' + text).encode('latin-1', 'replace'),
    lambda text, _: b'\x00' + text.encode(),
    lambda text, _: text.encode() + b'\xff',
    lambda _, chance: chance.randbytes(300),
    lambda *_: b'PK\x03\x04',
    _flipped,
    _flipped,
    _flipped,
]


def _socket(path, _):
    with socket.socket(socket.AF_UNIX) as listener:
        # The path of a socket is short.
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            listener.bind(f'/proc/self/fd/{folder}/{path.name}')
        finally:
            os.close(folder)


PLACES = [
    lambda *_: None,
    lambda path, _: path.mkdir(),
    lambda path, _: os.mkfifo(path),
    lambda path, _: path.symlink_to(path),
    lambda path, _: path.symlink_to('nowhere'),
    lambda path, _: path.symlink_to('/dev/zero'),
    lambda path, _: path.symlink_to('/dev/full'),
    lambda path, _: path.symlink_to('/proc/self/mem'),
    _socket,
]


def write_hostile(path, text, change, chance):
    """Write a file that is hostile in one place: by a change of its format, mostly, or any."""
    kind = chance.choices(['format', 'text', 'encoding', 'place'], [15, 4, 1, 1])[0]
    if kind == 'place':
        chance.choice(PLACES)(path, chance)
    elif kind == 'encoding':
        path.write_bytes(chance.choice(ENCODINGS)(text, chance))
    else:
        change = change if kind == 'format' else chance.choice(TEXT_CHANGES)
        path.write_text(change(text, chance), 'utf-8', 'surrogatepass', newline='')
