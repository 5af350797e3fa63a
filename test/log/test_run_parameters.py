"""Metadata records of a run come back as they were; an invalid one is a ValueError."""

from dataclasses import asdict
import json
from pathlib import Path

from klann_ros.kinematics import KlannGeometry
from klann_ros.log.run_parameters import (
    finding_record,
    leg_description,
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
from klann_ros.robot import robot_of
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


def test_the_output_of_ros2_topic_echo_is_a_file_that_every_program_takes(tmp_path: Path) -> None:
    geometry = KlannGeometry(l_ab=0.11)
    solver = SolverParameters('/solver_node', 7, geometry.as_dict())
    file = tmp_path / 'leg.yaml'
    # The tool prints a text, and ends it as a document of YAML.
    file.write_text(f'{leg_description(solver)}\n---\n', encoding='utf-8')
    (leg,) = robot_of(file).legs
    assert leg.linkage.dimensions['l_ab'] == 0.11
