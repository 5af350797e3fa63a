"""The laws: of damage, of legal files, and of cost."""

from collections import Counter
from contextlib import redirect_stderr, redirect_stdout
import hashlib
import io
from pathlib import Path
import random
import re
import resource
import shutil

from call_counter import Work
from fuzzing.damages import damage, damage_metadata
from fuzzing.hostile import FORGED
from fuzzing.oracle import sound_chunks
from fuzzing.samples import content, make_messages
from klann_ros.log import recover_command
from klann_ros.log.errors import NotALogError
from klann_ros.log.reader import open_log
from klann_ros.review import command as review_command
from klann_ros.sanitize.text import counted
from mcap_bytes.conformance import legal_file
from mcap_bytes.hostile import HEADER, packed_chunk
from mcap_bytes.records import record

MAX_MEMORY = 200 * 2**20
UNVERIFIED = 'no CRC, so damage'
KINDS = ('.mcap', '.db3', '.zstd')
# Calls for a byte of the file, for one that is unpacked, for a message, and at all.
EACH, UNPACKED, MESSAGE, ONCE = 30, 3, 30, 60_000
_OPCODES = (*range(17), 6, 6, 12, 128, 255)
_SIZE = 4000


def check(sample, seed, place):
    """Damage a copy of a run by a seed, and hold all that reads it to the laws."""
    chance = random.Random(seed)  # noqa: S311 - no secret
    log = place / sample.name
    shutil.copytree(sample.folder, log)
    story, traceless = [], False
    for path in sorted(path for path in log.iterdir() if path.suffix in KINDS):
        if chance.random() < 0.8:
            done, can_vanish = damage(path, chance)
            story += done
            traceless |= can_vanish
    if chance.random() < 0.2:
        story.append(damage_metadata(log, chance))
        traceless = True
    case = f'{sample.name}, seed {seed}: {", ".join(story)}'
    before = _digest(log)
    try:
        _check_recovery(log, sample, case, traceless=traceless)
        _check_reading(log, case)
        code, text = run(review_command.main, [str(log)])
        assert code in (0, 1, 2), case
        hold(text, case)
        assert _digest(log) == before, f'{case}: the input was changed'
    finally:
        shutil.rmtree(place)


def memory():
    """Return the most memory that this process has had so far [bytes]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def _check_recovery(log, sample, case, *, traceless):
    output = log.with_name('again')
    code, text = run(recover_command.main, [str(log), '-o', str(output)])
    hold(text, case)
    sound_messages = Counter()
    for path in log.glob('*.mcap'):
        for chunk in sound_chunks(path.read_bytes()):
            sound_messages.update(chunk.messages)
    if code == recover_command.NOTHING_READ:
        assert not output.exists(), case
        assert text.count('\n') == 1, f'{case}: {text}'
        # Chunks without a description of their topics, or behind a foreign start.
        assert not sound_messages or 'description' in text or _is_no_start(log), f'{case}: {text}'
        return
    assert code in (0, 3), f'{case}: {text}'
    assert (code == 3) == ('lost: ' in text), f'{case}: {text}'
    with open_log(output) as recovered_log:
        assert recovered_log.complete, f'{case}: {recovered_log.problem}'
        messages = [*map(content, recovered_log.messages())]
    assert f'kept: {counted(len(messages), "message")} in all' in text, case
    if 'is not a readable log' not in text and 'is missing' not in text:
        missing = sound_messages - Counter(messages)
        undescribed = sum(map(int, re.findall(r'(\d+) messages? of topics whose', text)))
        assert missing.total() <= undescribed, f'{case}: {missing.total()} lost\n{text}'
    if UNVERIFIED not in text:
        assert set(messages) <= sample.messages, f'{case}: a message was changed'
        complete = set(messages) == sample.messages
        assert code == 3 or traceless or complete, f'{case}: lost without a word\n{text}'
    if sample.name.startswith('sqlite3'):
        # SQLite has no CRC: changes are undetectable, missing messages are not.
        is_whole = len(messages) >= len(sample.messages)
        assert code == 3 or is_whole, f'{case}: lost without a word\n{text}'


def _is_no_start(log):
    return not any(
        path.read_bytes().startswith(b'\x89MCAP0\r\n\x01') for path in log.glob('*.mcap')
    )


def _check_reading(log, case):
    try:
        with open_log(log) as damaged_log:
            list(damaged_log.messages())
            list(damaged_log.messages(['/point_h'], start=damaged_log.start_time + 10**8))
            list(damaged_log.latest({'/point_h': 2}, damaged_log.end_time))
            assert isinstance(damaged_log.attachments, tuple), case
            hold('\n'.join(damaged_log.problems), case)
            assert all('\n' not in problem for problem in damaged_log.problems), case
    except NotALogError as error:
        assert str(error).isprintable(), case


def _digest(folder):
    files = sorted(Path(folder).iterdir())
    return [(path.name, hashlib.sha256(path.read_bytes()).digest()) for path in files]


def run(main, arguments):
    """Return the exit code of a command and all that it says."""
    said = io.StringIO()
    with redirect_stdout(said), redirect_stderr(said):
        code = main(arguments)
    return code, said.getvalue()


def hold(text, case, *, colours=False):
    """Hold all that was printed to the law: nothing moves the terminal, and no line is forged."""
    shown = text
    if colours:
        for code in ('1;31', '1;33', '36', '1;32', '1', '2', '0'):
            shown = shown.replace(f'\x1b[{code}m', '')
    odd = sorted({letter for letter in shown if not letter.isprintable()} - {'\n'})
    assert not odd, f'{case}: it says {odd!r}'
    forged = [line for line in shown.splitlines() if line.lstrip().startswith(FORGED)]
    assert not forged, f'{case}: {forged[0]}'


def check_legal(_, seed, place):
    """Write messages as a sound file of any legal shape by a seed; all of them are read."""
    chance = random.Random(seed)  # noqa: S311 - no secret
    messages = chance.sample(make_messages(), chance.randrange(60))
    log, case = place / 'legal_0.mcap', f'legal file, seed {seed}'
    place.mkdir()
    log.write_bytes(legal_file(messages, chance))
    with open_log(log) as legal_log:
        contents = Counter(map(content, legal_log.messages()))
        assert contents == Counter(map(content, messages)), case
        assert sum(map(len, legal_log.blocks())) == len(messages), case
        assert not legal_log.problems, f'{case}: {legal_log.problem}'
        assert [attachment.name for attachment in legal_log.attachments] == ['geometry.yaml'], case
        assert [*legal_log.metadata] == ['solver'], case
    code, text = run(recover_command.main, [str(log), '-o', str(place / 'again')])
    assert code == 0, f'{case}: {text}'
    assert f'kept: {counted(len(messages), "message")} in all, 1 attachment' in text, case
    _, text = run(review_command.main, [str(log)])
    assert 'the log is damaged' not in text, f'{case}: {text}'
    shutil.rmtree(place)


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
        message_count = _read(path)
    allowed = EACH * len(data) + UNPACKED * unpacked + MESSAGE * message_count + ONCE
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
