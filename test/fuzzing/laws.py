"""The laws for any damage: the recovered messages, the report, and the cost."""

from collections import Counter
import hashlib
from pathlib import Path
import random
import re
import resource
import shutil

from fuzzing.commands import run
from fuzzing.damages import damage, damage_metadata
from fuzzing.oracle import sound_chunks
from fuzzing.samples import content
from fuzzing.shown import hold
from klann_ros.log import recover_command
from klann_ros.log.errors import NotALogError
from klann_ros.log.reader import open_log
from klann_ros.review import command as review_command
from klann_ros.sanitize.text import counted

MAX_MEMORY = 200 * 2**20
UNVERIFIED = 'no CRC, so damage'
KINDS = ('.mcap', '.db3', '.zstd')


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
    sound = [chunk for path in log.glob('*.mcap') for chunk in sound_chunks(path.read_bytes())]
    wanted = Counter(message for chunk in sound for message in chunk.messages)
    if code == recover_command.NOTHING_READ:
        assert not output.exists(), case
        assert text.count('\n') == 1, f'{case}: {text}'
        # Chunks without a description of their topics, or behind a foreign start.
        assert not wanted or 'description' in text or _is_no_start(log), f'{case}: {text}'
        return
    assert code in (0, 3), f'{case}: {text}'
    assert (code == 3) == ('lost: ' in text), f'{case}: {text}'
    with open_log(output) as found:
        assert found.complete, f'{case}: {found.problem}'
        messages = [content(message) for message in found.messages()]
    assert f'kept: {counted(len(messages), "message")} in all' in text, case
    if 'is not a readable log' not in text and 'is missing' not in text:
        missing = wanted - Counter(messages)
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
        with open_log(log) as found:
            list(found.messages())
            list(found.messages(['/point_h'], start=found.start_time + 10**8))
            list(found.latest({'/point_h': 2}, found.end_time))
            assert isinstance(found.attachments, tuple), case
            hold('\n'.join(found.problems), case)
            assert all('\n' not in problem for problem in found.problems), case
    except NotALogError as error:
        assert str(error).isprintable(), case


def _digest(folder):
    files = sorted(Path(folder).iterdir())
    return [(path.name, hashlib.sha256(path.read_bytes()).digest()) for path in files]
