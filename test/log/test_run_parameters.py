"""Metadata records of a run come back as they were; an invalid one is a ValueError."""

from dataclasses import asdict
import json

from klann_ros.log.run_parameters import (
    finding_record,
    loss_record,
    Pause,
    pause_record,
    recorded_finding,
    recorded_pause,
    RecordedFinding,
    solver_parameters,
    solver_record,
    SolverParameters,
    topic_counts,
    TopicCount,
)
import pytest

COUNT = asdict(TopicCount(1, 1))
PAUSE = pause_record(Pause(10, 20, {}, 'stall'))
FINDING = finding_record(RecordedFinding('gap', 'error', 'what', 5))
DEEP = '[' * 100_000


@pytest.mark.parametrize(
    ('write', 'read', 'value'),
    [
        (pause_record, recorded_pause, Pause(10, 20, {'/x': 3})),
        (pause_record, recorded_pause, Pause(10, 20, {}, 'a stall')),
        (finding_record, recorded_finding, RecordedFinding('gap', 'error', 'what', 5, '/a')),
        (solver_record, solver_parameters, SolverParameters('/solver', 7, {'legs': ['a']})),
        (
            loss_record,
            topic_counts,
            {'/a': TopicCount(9, 5, 1, 2, None, 3, 4), '/b': TopicCount(1, 1)},
        ),
    ],
)
def test_a_record_is_written_and_read(write, read, value) -> None:
    assert read(write(value)) == value


INFINITE = json.dumps(COUNT | {'received': 'x'}).replace('"x"', '1e400')
LOSSES = ['many', '[]', '{}', '7', INFINITE, json.dumps(COUNT | {'missed': [1]}), DEEP]


@pytest.mark.parametrize(
    ('read', 'what', 'record'),
    [
        *((topic_counts, 'losses', {'/a': text}) for text in LOSSES),
        *(
            (solver_parameters, 'a solver', {'node': '/a', 'time': '1', 'parameters': text})
            for text in (DEEP, '7', '["a"]')
        ),
        *(
            (recorded_pause, 'a pause', PAUSE | {key: text})
            for key in ('from', 'to', 'skipped')
            for text in ('much', '[]')
        ),
        (recorded_pause, 'a pause', {'from': '1', 'to': '2'}),
        (recorded_pause, 'a pause', PAUSE | {'skipped': '3'}),
        (recorded_finding, 'a finding', FINDING | {'time': 'x'}),
        (recorded_finding, 'a finding', {'check': 'gap'}),
    ],
)
def test_an_invalid_record_is_a_value_error(read, what, record) -> None:
    with pytest.raises(ValueError, match=f'not a record of {what}'):
        read(record)
