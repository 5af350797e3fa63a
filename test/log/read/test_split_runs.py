"""A run of several files, whatever became of some of them, is read and recovered as one."""

import shutil

from crank_runs import joined, MESSAGES, write_run
from klann_ros.log.bag_metadata import ROOT_KEY
from klann_ros.log.reader import open_log
from klann_ros.log.recover_command import main
from klann_ros.log.recovery import recover
from klann_ros.sanitize import yaml_text
import pytest
import yaml

PARTS = [MESSAGES[slice(start, start + 20)] for start in range(0, 240, 20)]
# As text, 10 and 11 would come before 2.
NAMES = [f'run_{number}.mcap' for number in range(len(PARTS))]


@pytest.fixture
def split_run(tmp_path):
    """Write a run of twelve files, each of which says what the run is."""
    folder = tmp_path / 'run'
    folder.mkdir()
    for name, part in zip(NAMES, PARTS, strict=True):
        shutil.move(write_run(tmp_path / 'part', [part]), folder / name)
        shutil.rmtree(tmp_path / 'part')
    name_files(folder, NAMES)
    return folder


def name_files(folder, names):
    (folder / 'metadata.yaml').write_text(
        yaml.safe_dump({ROOT_KEY: {'version': 9, 'relative_file_paths': names}})
    )


@pytest.mark.parametrize('with_metadata', [True, False])
def test_the_files_are_one_log_and_repeated_records_are_read_once(
    split_run, tmp_path, with_metadata
) -> None:
    # Hidden files are not of the run.
    for name in ('.reserve', '.copy.mcap'):
        (split_run / name).write_bytes(bytes(100))
    if not with_metadata:
        (split_run / 'metadata.yaml').unlink()
    recovery = recover(split_run, tmp_path / 'again')
    assert (recovery.attachments, recovery.metadata, recovery.lost) == (1, 1, [])
    for run in (split_run, tmp_path / 'again'):
        with open_log(run) as log:
            assert log.complete, log.problem
            assert list(log.messages()) == MESSAGES
            assert len(log.topics) == 1
            assert [item.name for item in log.attachments] == ['geometry.yaml']
            assert log.metadata['solver'] == [{'tolerance': '1e-12'}]
    with open_log(split_run) as log:
        assert [path.name for path in log.paths] == NAMES


def test_a_file_behind_those_that_are_named_is_read_and_reported(split_run, tmp_path) -> None:
    """When a split recording is killed its metadata.yaml may be a file behind."""
    name_files(split_run, NAMES[:-1])
    with open_log(split_run) as log:
        assert list(log.messages()) == MESSAGES
        assert 'run_11.mcap is not named in metadata.yaml; it continues the run' in log.problem
    recovery = recover(split_run, tmp_path / 'again')
    assert (recovery.messages, recovery.lost) == (240, [])
    assert any('run_11.mcap' in remark for remark in recovery.remarks)


@pytest.mark.parametrize('name', ['copy.mcap', 'run_copy.mcap', 'copy_99.mcap'])
def test_a_file_of_another_name_is_left_out_and_reported(split_run, name) -> None:
    shutil.copy(split_run / 'run_0.mcap', split_run / name)
    with open_log(split_run) as log:
        assert list(log.messages()) == MESSAGES
        assert f'{name} is not named in metadata.yaml, and is left out' in log.problem


def test_the_good_files_come_back_beside_the_bad(split_run, tmp_path, capsys) -> None:
    (split_run / 'run_1.mcap').write_bytes(b'nothing of the kind')
    data = (split_run / 'run_2.mcap').read_bytes()
    (split_run / 'run_2.mcap').write_bytes(data[:-300])
    (split_run / 'run_3.mcap').unlink()
    (split_run / 'run_10.mcap').write_bytes(b'')
    assert main([str(split_run), '-o', str(tmp_path / 'again')]) == 3
    printed = capsys.readouterr().out
    for problem in (
        'run_1.mcap is not a readable log: it does not start as an MCAP file does',
        'run_3.mcap is missing',
        'run_10.mcap is not a readable log: the file is empty',
    ):
        assert problem in printed
    kept = joined([PARTS[0], *PARTS[2:3], *PARTS[4:10], PARTS[11]])
    for run in (split_run, tmp_path / 'again'):
        with open_log(run) as log:
            assert list(log.messages()) == kept


def test_metadata_yaml_cannot_lead_out_of_the_folder(split_run, tmp_path) -> None:
    shutil.copy(split_run / 'run_0.mcap', tmp_path / 'other.mcap')
    name_files(split_run, ['../other.mcap'])
    with open_log(split_run) as log:
        assert 'other.mcap is missing' in log.problem
        assert all(path.parent == split_run for path in log.paths)


MALFORMED = {
    'no YAML': '}{',
    'a list': '[]',
    'nothing': '',
    'a number': '1',
    'a number in it': f'{ROOT_KEY}: 3',
    'an unknown mode': f'{ROOT_KEY}: {{compression_mode: flie}}',
}
# They unfold without end.
ENDLESS = {
    'references': 'a: &a [x, x]\n'
    + ''.join(f'b{n}: &b [*a, *a]\na{n}: &a [*b, *b]\n' for n in range(40)),
    'length': '- a\n' * 20_000,
}


@pytest.mark.parametrize('kind', [*MALFORMED, *ENDLESS])
def test_a_damaged_metadata_yaml_is_reported_and_the_files_are_read(
    split_run, kind, monkeypatch
) -> None:
    monkeypatch.setattr(yaml_text, '_MAX_WEIGHT', 10_000)
    (split_run / 'metadata.yaml').write_text((MALFORMED | ENDLESS)[kind])
    with open_log(split_run) as log:
        reason = 'not YAML' if kind in ENDLESS else ''
        assert f'metadata.yaml is damaged: {reason}' in log.problem
        assert len(log.problem) < 300
        assert list(log.messages()) == MESSAGES
