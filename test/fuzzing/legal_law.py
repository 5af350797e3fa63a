"""The law of legal files: anything that the specification allows is read without a loss."""

import random
import shutil

from fuzzing.commands import run
from fuzzing.samples import content
from klann_ros.log import recover_command
from klann_ros.log.reader import open_log
from klann_ros.review import command as review_command
from klann_ros.sanitize.text import counted
from mcap_bytes.legal import change_file


def check_legal(sample, seed, place):
    """Change a copy of a run by a seed, if it is sound; it stays so, and all that is in it."""
    with open_log(sample.folder) as before:
        if before.problems:
            return
    log = place / sample.name
    shutil.copytree(sample.folder, log)
    chance = random.Random(seed)  # noqa: S311 - no secret
    try:
        for path in sorted(log.glob('*.mcap')):
            change_file(path, chance)
        _check(log, sample, f'{sample.name}, seed {seed}, changed legally')
    finally:
        shutil.rmtree(place)


def _check(log, sample, case):
    with open_log(log) as found:
        messages = [content(message) for message in found.messages()]
        in_blocks = sum(map(len, found.blocks()))
        others = _others(found)
        assert not found.problems, f'{case}: {found.problem}'
        assert (len(messages), in_blocks) == (len(sample.messages),) * 2, case
        assert set(messages) == sample.messages, case
    with open_log(sample.folder) as before:
        assert others == _others(before), case
    code, text = run(recover_command.main, [str(log), '-o', str(log.with_name('again'))])
    assert code == 0, f'{case}: {text}'
    kept = counted(len(messages), 'message'), counted(len(others[0]), 'attachment')
    assert 'kept: {} in all, {}'.format(*kept) in text, case
    _, text = run(review_command.main, [str(log)])
    assert 'the log is damaged' not in text, f'{case}: {text}'


def _others(log):
    """Return the names of attachments and metadata records."""
    return [item.name for item in log.attachments], sorted(log.metadata)
