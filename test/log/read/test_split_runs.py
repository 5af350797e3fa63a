"""A run of several files, whatever became of some of them, is read and recovered as one."""

import shutil

from crank_runs import BATCHES, joined, MESSAGES, write_run
from klann_ros.log.reader import open_log
from klann_ros.log.recover_command import main
from klann_ros.log.recovery import recover
from klann_ros.sanitize import yaml_text
import pytest
import yaml


@pytest.fixture
def split_run(tmp_path):
    """Write a run of three files, each of which says what the run is."""
    folder = tmp_path / 'run'
    folder.mkdir()
    for number in range(3):
        pair = BATCHES[slice(2 * number, 2 * number + 2)]
        path = write_run(tmp_path / f'part{number}', pair)
        shutil.move(path, folder / f'run_{number}.mcap')
    name_files(folder, ['run_0.mcap', 'run_1.mcap', 'run_2.mcap'])
    return folder


def name_files(folder, names):
    metadata = {'rosbag2_bagfile_information': {'version': 9, 'relative_file_paths': names}}
    (folder / 'metadata.yaml').write_text(yaml.safe_dump(metadata))


def test_what_each_file_repeats_is_there_once(split_run, tmp_path) -> None:
    recovery = recover(split_run, tmp_path / 'again')
    assert (recovery.attachments, recovery.metadata, recovery.lost) == (1, 1, [])
    for run in (split_run, tmp_path / 'again'):
        with open_log(run) as log:
            assert log.complete, log.problem
            assert list(log.messages()) == MESSAGES
            assert [item.name for item in log.attachments] == ['geometry.yaml']
            assert log.metadata['solver'] == [{'tolerance': '1e-12'}]


def test_a_file_behind_those_that_are_named_is_read_and_reported(split_run, tmp_path) -> None:
    """When a split recording is killed its metadata.yaml may be a file behind."""
    name_files(split_run, ['run_0.mcap', 'run_1.mcap'])
    with open_log(split_run) as log:
        assert list(log.messages()) == MESSAGES
        assert 'run_2.mcap is not named in metadata.yaml; it continues the run' in log.problem
    recovery = recover(split_run, tmp_path / 'again')
    assert recovery.messages == 240
    assert recovery.lost == []
    assert any('run_2.mcap' in remark for remark in recovery.remarks)


@pytest.mark.parametrize('name', ['copy.mcap', 'run_copy.mcap', 'copy_9.mcap'])
def test_a_file_of_another_name_is_left_out_and_reported(split_run, name) -> None:
    shutil.copy(split_run / 'run_0.mcap', split_run / name)
    with open_log(split_run) as log:
        assert list(log.messages()) == MESSAGES
        assert f'{name} is not named in metadata.yaml, and is left out' in log.problem


@pytest.mark.parametrize('with_metadata', [True, False])
def test_hidden_files_are_not_of_the_run(split_run, with_metadata) -> None:
    if not with_metadata:
        (split_run / 'metadata.yaml').unlink()
    for name in ('.reserve', '.copy.mcap'):
        (split_run / name).write_bytes(bytes(100))
    with open_log(split_run) as log:
        assert log.complete, log.problem
        assert list(log.messages()) == MESSAGES


def test_the_good_files_come_back_beside_the_bad(split_run, tmp_path, capsys) -> None:
    (split_run / 'run_1.mcap').write_bytes(b'nothing of the kind')
    data = (split_run / 'run_2.mcap').read_bytes()
    (split_run / 'run_2.mcap').write_bytes(data[:-300])
    assert main([str(split_run), '-o', str(tmp_path / 'again')]) == 3
    said = capsys.readouterr().out
    assert 'run_1.mcap is not a readable log: it does not start as an MCAP file does' in said
    with open_log(tmp_path / 'again') as log:
        assert list(log.messages()) == joined([*BATCHES[:2], *BATCHES[4:]])


@pytest.mark.parametrize(
    'text',
    [
        'a: &a [x, x]\n' + ''.join(f'b{n}: &b [*a, *a]\na{n}: &a [*b, *b]\n' for n in range(40)),
        'a: &a {x: 1}\n'
        + ''.join(f'b{n}: &b\n  <<: [*a, *a]\na{n}: &a\n  <<: [*b, *b]\n' for n in range(40)),
        '[' * 10_000,
        '- a\n' * 20_000,
    ],
    ids=['references', 'merges', 'depth', 'length'],
)
def test_a_metadata_yaml_that_unfolds_without_end_is_reported(
    split_run, text, monkeypatch
) -> None:
    monkeypatch.setattr(yaml_text, '_MAX_WEIGHT', 10_000)
    (split_run / 'metadata.yaml').write_text(text)
    with open_log(split_run) as log:
        assert 'metadata.yaml is damaged: not YAML' in log.problem
        assert len(log.problem) < 300
        assert list(log.messages()) == MESSAGES
