"""
MCAP's own conformance suite: 416 sound files, each read whole and never called damaged.

The suite pads records outside of chunks with three bytes. Two more kinds of padding are legal: of
the chunk and the records in it, and with bytes that look like records.
"""

import hashlib
from operator import itemgetter

from klann_ros.log.reader import open_log
from klann_ros.log.recovery import recover
from mcap_bytes import records as mcap
from mcap_bytes.conformance import CHUNKS, conformance_file, INPUTS, PAD, PADDING, variants
import pytest

FILES = [(name, content, flags) for name, content, flags in variants() if PAD not in flags]
PADDED = [(name, content, flags) for name, content, flags in variants() if PAD in flags]
# Of all files in the order of their names. One by one they have the SHA-256 of the suite's own.
DIGEST = '814c30e436ffa153c5ac3de5b48fe4187cff7418a9e45d4c974f9eac5d79f593'
LOOKS_LIKE_RECORDS = mcap.message(1, 1, 1, 1, b'x') + b'\x06' + bytes(8) + b'\x80'
# A file without chunks has no padding in one: it would be the suite's own file once more.
CHUNKED = [(name, content, flags) for name, content, flags in PADDED if CHUNKS in flags]
KINDS = {
    'not at all': (FILES, {}),
    'as the suite does': (PADDED, {}),
    'in chunks as well': (CHUNKED, {'pad_inner': PADDING}),
    'with what looks like records': (
        PADDED,
        {'pad': LOOKS_LIKE_RECORDS, 'pad_inner': LOOKS_LIKE_RECORDS},
    ),
}

CASES = [
    (kind, content.name)
    for kind, (files, _) in KINDS.items()
    for content in INPUTS
    if any(content is file_content for _, file_content, _ in files)
]


@pytest.fixture(scope='module', params=CASES, ids=' '.join)
def files(request, tmp_path_factory):
    """Write the files of one content in one kind of padding; return each with what it holds."""
    padding, content_name = request.param
    folder, (kind, pads) = tmp_path_factory.mktemp('files'), KINDS[padding]
    paths = []
    for name, content, flags in kind:
        if content.name == content_name:
            path = folder / f'{name}.mcap'
            path.write_bytes(conformance_file(content, flags, **pads))
            paths.append((path, content))
    return paths


def test_the_suite_has_its_416_files_half_of_them_padded() -> None:
    digest = hashlib.sha256()
    for _, content, flags in sorted(variants(), key=itemgetter(0)):
        digest.update(conformance_file(content, flags))
    assert (len(FILES), len(PADDED)) == (208, 208)
    assert digest.hexdigest() == DIGEST


def of_log(log):
    """Return the counts of what a log holds: in the order of `Input.counts`."""
    types = {(topic.type, topic.definition) for topic in log.topics if topic.schema_encoding}
    message_count = sum(map(len, log.blocks()))
    metadata_count = sum(map(len, log.metadata.values()))
    return message_count, len(types), len(log.topics), len(log.attachments), metadata_count


def test_they_are_read_whole_and_have_no_problem(files) -> None:
    for path, content in files:
        with open_log(path) as log:
            assert of_log(log) == content.counts, path.name
            messages = [(m.sequence, m.log_time, m.publish_time, m.data) for m in log.messages()]
            written_messages = [item[1:] for item in content.messages]
            assert messages == sorted(written_messages, key=itemgetter(1)), path.name
            assert log.problems == (), path.name


@pytest.mark.slow
def test_recover_keeps_all_of_them(files, tmp_path) -> None:
    # A recovery reads as the library here does; some of them are enough.
    for path, content in files[::8]:
        recovery = recover(path, tmp_path / path.stem)
        assert (recovery.lost, recovery.remarks) == ([], []), path.name
        messages, _, _, attachments, metadata = content.counts
        assert recovery.messages == messages, path.name
        assert (recovery.attachments, recovery.metadata) == (attachments, metadata), path.name


@pytest.mark.slow
def test_a_file_of_a_killed_writer_is_read_completely(files, tmp_path) -> None:
    for closed_path, content in files:
        data = closed_path.read_bytes()
        spans = mcap.spans(data, 8, len(data) - 8)
        end = next(start for opcode, start, _ in spans if opcode == mcap.DATA_END)
        path = tmp_path / closed_path.name
        path.write_bytes(data[:end])
        with open_log(path) as log:
            assert of_log(log) == content.counts, path.name
            assert len(log.problems) == 1, f'{path.name}: {log.problems}'
            assert 'not closed' in log.problem
