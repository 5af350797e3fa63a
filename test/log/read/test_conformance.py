"""
MCAP's own conformance suite: 416 sound files, each read whole and never called damaged.

The suite pads records outside of chunks with three bytes. Two more kinds of padding are legal: of
the chunk and the records in it, and with bytes that look like records.
"""

from collections import Counter
import hashlib
from operator import itemgetter

from klann_ros.log import recover_command
from klann_ros.log.reader import open_log
from klann_ros.review import command as review_command
from mcap import records
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from mcap_bytes import records as mcap
from mcap_bytes.conformance import (
    ATTACHMENT_INDEX,
    CHANNELS,
    CHUNK_INDEX,
    CHUNKS,
    conformance_file,
    INPUTS,
    METADATA_INDEX,
    PAD,
    PADDING,
    SCHEMAS,
    variants,
)
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
    if any(content is other for _, other, _ in files)
]


# The commands read as the library here does; the hardest padding is enough for them.
of_the_commands = pytest.mark.parametrize(
    'case', [case for case in CASES if case[0].startswith('with what looks')], indirect=True
)


@pytest.fixture(params=CASES, ids=' '.join)
def case(request):
    return request.param


@pytest.fixture
def padding(case):
    return case[0]


@pytest.fixture
def files(case, tmp_path):
    """Write the files of one content in one kind of padding; return each with what it holds."""
    padding, wanted = case
    found = []
    for name, content, flags in KINDS[padding][0]:
        if content.name == wanted:
            path = tmp_path / f'{name}.mcap'
            path.write_bytes(conformance_file(content, flags, **KINDS[padding][1]))
            found.append((path, content, flags))
    return found


def test_the_suite_has_its_416_files_half_of_them_padded() -> None:
    digest = hashlib.sha256()
    for _, content, flags in sorted(variants(), key=itemgetter(0)):
        digest.update(conformance_file(content, flags))
    assert (len(FILES), len(PADDED)) == (208, 208)
    assert digest.hexdigest() == DIGEST


def by_library(path):
    """Return the counts of what the mcap library streams: in the order of `Input.counts`."""
    found, numbers = Counter(), {records.Schema: set(), records.Channel: set()}
    with path.open('rb') as file:
        for record in StreamReader(file).records:
            found[type(record)] += 1
            if type(record) in numbers:
                numbers[type(record)].add(record.id)
    return (
        found[records.Message],
        len(numbers[records.Schema]),
        len(numbers[records.Channel]),
        found[records.Attachment],
        found[records.Metadata],
    )


def by_index(path, flags):
    """Yield the counts of what the library finds by an index, where there is one."""
    with path.open('rb') as file:
        reader = make_reader(file)
        # Without the schemas in the summary the library cannot look theirs up.
        if flags >= {CHUNK_INDEX, CHANNELS} and (SCHEMAS in flags or 'Schemaless' in path.name):
            yield 0, sum(1 for _ in reader.iter_messages())
        if ATTACHMENT_INDEX in flags:
            yield 3, sum(1 for _ in reader.iter_attachments())
        if METADATA_INDEX in flags:
            yield 4, sum(1 for _ in reader.iter_metadata())


def of_log(log):
    """Return the counts of what a log holds: in the order of `Input.counts`."""
    types = {(topic.type, topic.definition) for topic in log.topics if topic.schema_encoding}
    metadata = sum(map(len, log.metadata.values()))
    return (
        sum(1 for _ in log.messages()),
        len(types),
        len(log.topics),
        len(log.attachments),
        metadata,
    )


def test_they_are_read_whole_and_have_no_problem(files) -> None:
    for path, content, _ in files:
        with open_log(path) as log:
            assert of_log(log) == content.counts, path.name
            assert sum(map(len, log.blocks())) == len(content.messages), path.name
            found = [(m.sequence, m.log_time, m.publish_time, m.data) for m in log.messages()]
            wanted = [item[1:] for item in content.messages]
            assert found == sorted(wanted, key=itemgetter(1)), path.name
            assert log.problems == (), path.name


def test_the_library_counts_the_same(files, padding) -> None:
    for path, content, flags in files:
        # It takes unknown fields in a chunk for records: there it can be no oracle.
        if CHUNKS in flags and KINDS[padding][1]:
            continue
        assert by_library(path) == content.counts, path.name
        with open_log(path) as log:
            counts = of_log(log)
        assert all(counts[place] == count for place, count in by_index(path, flags)), path.name


@of_the_commands
def test_recover_keeps_all_of_them(files, tmp_path, capsys) -> None:
    for path, content, _ in files:
        code = recover_command.main([str(path), '-o', str(tmp_path / path.stem)])
        said = capsys.readouterr().out
        assert code == 0, f'{path.name}: {said}'
        assert 'lost' not in said, f'{path.name}: {said}'
        assert 'note' not in said, f'{path.name}: {said}'
        with open_log(tmp_path / path.stem) as log:
            log.metadata.pop('rosbag2')
            messages, _, channels, attachments, metadata = content.counts
            kept = of_log(log)
        assert (kept[0], *kept[2:]) == (messages, channels, attachments, metadata), path.name


@of_the_commands
def test_review_does_not_call_them_damaged(files, capsys) -> None:
    for path, _, _ in files:
        assert review_command.main([str(path)]) in (0, 1), path.name
        assert 'damaged' not in capsys.readouterr().out, path.name


def test_a_file_of_a_killed_writer_is_read_completely(files) -> None:
    for path, content, _ in files:
        data = path.read_bytes()
        spans = mcap.spans(data, 8, len(data) - 8)
        end = next(start for opcode, start, _ in spans if opcode == mcap.DATA_END)
        path.write_bytes(data[:end])
        with open_log(path) as log:
            assert of_log(log) == content.counts, path.name
            assert len(log.problems) == 1, f'{path.name}: {log.problems}'
            assert 'not closed' in log.problem
