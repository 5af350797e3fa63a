"""
Which records of a file are believed: to end where they say, and to be what they say.

Whatever the specification allows is believed: records that are longer than their fields, of kinds
that are private or of a later version, whatever is in them. A summary that names all chunks,
attachments and metadata records settles what else would be a matter of taste.
"""

from klann_ros.log.errors import DamagedError
from klann_ros.log.read.storage import Problem
from mcap.opcode import Opcode

from .container import check_data, contradiction, name_of, span_at
from .evidence import Behind, Evidence, Inside
from .layout import fields_end, holds_nothing, is_known, RecordSpan
from .resync import Search
from .summary import Summary

_NO, _ALONE, _YES = 'no', 'unless a sound chunk starts in it', 'yes'
# Whether a record is believed to end where it says.
_END = {
    #                 NONE    FITTING EXACT   PROVEN   is what its content says for it
    Behind.RECORD: (_YES, _YES, _YES, _YES),
    Behind.PERHAPS: (_ALONE, _ALONE, _ALONE, _ALONE),
    Behind.NOTHING: (_NO, _NO, _ALONE, _ALONE),
}
_CHECKED = (Opcode.CHUNK, Opcode.ATTACHMENT)
# So many records one behind the other are no unknown fields.
_ROW = 16
_MOST = 100
# How many zeros the fields of a record end in that holds nothing: a length, and a CRC [bytes].
_EMPTY: dict[int, int] = {Opcode.CHUNK: 8, Opcode.ATTACHMENT: 8 + 4, Opcode.METADATA: 4}


class Belief:
    """
    Judges the records of an open file.

    Attributes
    ----------
    wrong
        What was not believed, though nothing is lost by it.
    remarks
        What was believed, though it looks odd, one line each.

    """

    def __init__(self, evidence: Evidence, search: Search, summary: Summary) -> None:
        self._evidence = evidence
        self._file, self._size = evidence.file, evidence.size
        self._search = search
        self._summary = summary
        self.wrong: list[Problem] = []
        self.remarks: list[str] = []

    def in_end(self, span: RecordSpan, *, chunked: bool) -> bool:
        """Return whether a record ends where it says, in a file that has chunks or has none."""
        behind = self._evidence.behind(span.end)
        # What is in one that is followed by another does not matter, and is read later.
        inside = Inside.NONE if behind is Behind.RECORD else self._evidence.inside(span)
        believed = _END[behind][inside]
        if believed is _YES:
            return not self._covers_records(span)
        if believed is _ALONE and self._is_alone(span, inside):
            return True
        return span.opcode == Opcode.MESSAGE and self._is_before_damage(span, chunked=chunked)

    def without_end(self, span: RecordSpan) -> RecordSpan | None:
        """Return as much of a record that does not end where it says as a CRC proves, if any."""
        end = fields_end(self._file, span)
        if end is None or end == span.end or self._evidence.inside(span) < Inside.PROVEN:
            return None
        if len(self.wrong) < _MOST:
            text = f'the length of the {name_of(span.opcode)} is damaged, what is in it is whole'
            self.wrong.append(Problem(span.offset, text))
        return RecordSpan(span.opcode, span.offset, end - span.start)

    def sound_behind(self, start: int, *, chunked: bool) -> tuple[int | None, bool]:
        """Return where to go on behind a damaged record, and whether that is where it ends."""
        end = self._summary.end_of(start)
        if end is None or self._evidence.behind(end) is Behind.NOTHING:
            return self._search.record(start + 1, chunked=chunked), False
        over = end if self._summary.kind_at(start) == Opcode.ATTACHMENT else 0
        moved = self._search.chunk(start + 1, end, over=over)
        return (end, True) if moved is None else (moved, False)

    def against_content(self, span: RecordSpan) -> str:
        """Return what is wrong with a record that ends where it says, in one line; '' for none."""
        kind = self._summary.kind_at(span.offset)
        if kind not in (None, span.opcode):
            return f'the {name_of(span.opcode)} is a {name_of(kind)} in the index'
        end = fields_end(self._file, span)
        if end is None:
            return contradiction(span)
        if end < span.end:
            if self._is_wiped(span, end):
                return f'there are zeros where the content of the {name_of(span.opcode)} began'
            kind = self._disguised(span)
            if kind is not None:
                return f'the {name_of(span.opcode)} is a {name_of(kind)} by its content'
        return ''

    def in_data(self, end: RecordSpan) -> bool:
        """Return whether all before the end of the data has a CRC that holds."""
        try:
            return check_data(self._file, end)
        except DamagedError as damage:
            text = f'{damage.reason}: something in it was changed'
            self.wrong.append(Problem(end.offset, text))
            return False

    def _is_alone(self, span: RecordSpan, inside: Inside) -> bool:
        """Return whether no other record seems to start in one."""
        over = 0
        if inside >= Inside.EXACT:
            end = fields_end(self._file, span) or span.end
            if end < span.end and self._evidence.behind(end) is Behind.RECORD:
                return False
            # What has no CRC may be whole by its lengths, and yet reach into a chunk behind a gap.
            over = end if span.opcode in _CHECKED else 0
        return self._search.chunk(span.start, span.end, over=over) is None

    def _is_before_damage(self, span: RecordSpan, *, chunked: bool) -> bool:
        """Return whether it is the next record that is damaged, not the length of this message."""
        self._file.seek(span.end)
        opcode = self._file.read(1)
        if not opcode or not is_known(opcode[0]):
            return False
        found = self._search.record(span.start, chunked=chunked)
        return found is None or found >= span.end

    def _covers_records(self, span: RecordSpan) -> bool:
        """
        Return whether other records stand behind the fields of one, instead of unknown fields.

        These may look like records. In a file that is closed and has no index they are believed to
        be fields, as the specification says, and it is remarked.
        """
        end = fields_end(self._file, span) if is_known(span.opcode) else None
        if end is None or end == span.end:
            return False
        if self._summary.names_all:
            place = self._summary.first_from(end)
            return place is not None and place < span.end
        found = self._are_records(end, span.end)
        if found and self._summary.closed and len(self.remarks) < _MOST:
            name = name_of(span.opcode)
            self.remarks.append(
                f'at byte {end}: what stands behind the fields of a {name} looks like records; '
                f'it belongs to the {name}, which says that it is so long'
            )
        return found and not self._summary.closed

    def _are_records(self, start: int, end: int) -> bool:
        """Return whether records fill the place between two offsets."""
        for _ in range(_ROW):
            if start == end:
                return True
            try:
                span = span_at(self._file, start, end)
            except DamagedError:
                return False
            if not is_known(span.opcode) or fields_end(self._file, span) is None:
                return False
            start = span.end
        return True

    def _is_wiped(self, span: RecordSpan, end: int) -> bool:
        """
        Return whether zeros stand over the head of a record, and behind that what it held.

        What is left looks like one that is empty, with fields behind it that nobody knows.
        """
        size = _EMPTY.get(span.opcode)
        if size is None or not holds_nothing(self._file, span):
            return False
        self._file.seek(end - size)
        return not any(self._file.read(size + 1)) and self._summary.size_at(span.offset) != 0

    def _disguised(self, span: RecordSpan) -> Opcode | None:
        """Return what a record is by a CRC in it, where its opcode says something else."""
        if self._summary.names_all:
            return None
        for kind in _CHECKED:
            other = RecordSpan(kind, span.offset, span.length)
            fits = kind != span.opcode and fields_end(self._file, other) == span.end
            if fits and self._evidence.inside(other) is Inside.PROVEN:
                return kind
        return None
