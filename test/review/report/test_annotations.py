"""An annotated run has every message of the log byte for byte, and the truth beside it."""

from collections import defaultdict
from pathlib import Path
from typing import Any

from fork_server import called, PYTHON
from klann_ros.kinematics import KlannGeometry, KlannLeg
from klann_ros.log import Message, open_log, RunWriter, Topic
from klann_ros.log.recovery import recover
from klann_ros.review.command import main
from klann_ros.review.report.annotations import annotate
from klann_ros.review.reviewing import review_run
from leg_runs import LegRun
from mcap.reader import make_reader, NonSeekingReader
from mcap_ros2.decoder import DecoderFactory
import numpy as np
import pytest
from review_findings import checks
from rosbag2_bags import convert, KINDS, NAMES
from rosbags.highlevel import AnyReader
import yaml

# A stamp has 31 bits of seconds.
AFTER_2038 = 2**31 * 10**9
ANNOTATIONS = ['/review/findings', '/review/joint_states', '/review/point_h']


@pytest.fixture
def faulty(make_script: Any, make_run: Any) -> Path:
    """Return a run of 400 poses with a wrong angle, a wrong foot and a crank out of reach."""
    script = make_script()
    script.answers[100].pose[2] += 1e-3
    script.change(200, foot=(1.0, 1.0))
    # This finding has no time: it stands at the start.
    script.add_counts({'/joint_states': {'received': 400, 'written': 400, 'missed': 1}})
    return make_run(script)


def annotated(run: Path, folder: Path) -> Path:
    assert main([str(run), '--annotate', str(folder)]) in (0, 1)
    (file,) = folder.glob('*.mcap')
    return file


def messages(run: Path) -> list[Any]:
    """Return topic, times, number and bytes of all messages by time."""
    with open_log(run) as log:
        return sorted(
            (m.topic.name, m.log_time, m.publish_time, m.sequence, m.data) for m in log.messages()
        )


def without_annotations(run: Path) -> list[Any]:
    return [message for message in messages(run) if message[0] not in ANNOTATIONS]


def decoded_by_topic(file: Path) -> dict[str, dict[int, Any]]:
    """Return the messages of each topic by log time, decoded by a public library."""
    by_topic: dict[str, dict[int, Any]] = defaultdict(dict)
    with file.open('rb') as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages():
            by_topic[channel.topic][message.log_time] = decoded
    return by_topic


def test_the_messages_are_those_of_the_run_and_the_answers_right(
    faulty: Path, tmp_path: Path
) -> None:
    file = annotated(faulty, tmp_path / 'out')
    assert without_annotations(file.parent) == messages(faulty)
    by_topic = decoded_by_topic(file)
    poses = by_topic['/joint_states']
    findings, states, feet = (by_topic[name] for name in ANNOTATIONS)
    assert poses.keys() == states.keys() == feet.keys()
    assert len(poses) == 400
    for time, recorded in poses.items():
        right = KlannLeg().closed_form(recorded.position[0])
        assert states[time].name == recorded.name
        stamp = str(recorded.header.stamp)
        assert str(states[time].header.stamp) == str(feet[time].header.stamp) == stamp
        np.testing.assert_allclose(states[time].position, right.joints, atol=1e-12)
        point = feet[time].point
        np.testing.assert_allclose((point.x, point.y, point.z), (*right.h, 0.0), atol=1e-12)
    review = review_run(faulty)
    assert len(findings) == len(review.findings)
    for finding in review.findings:
        (status,) = findings[review.recording.start + round(1e9 * (finding.time or 0.0))].status
        assert status.name == f'review: {finding.check}'
        assert (status.message, status.level) == (finding.text, int(finding.severity))
    assert checks(review_run(file.parent)) == checks(review)


@pytest.mark.parametrize('compression', ['zstd', 'lz4', 'none'])
def test_foreign_readers_and_the_recovery_read_all_of_it(
    faulty: Path, tmp_path: Path, write_messages: Any, compression: str
) -> None:
    run = write_messages(faulty, write_messages.read(faulty), compression=compression)
    file = annotated(run, tmp_path / 'out')
    with open_log(file.parent) as log:
        counts = {t.name: sum(1 for _ in log.messages([t.name])) for t in log.topics}
        assert log.complete
    with AnyReader([file.parent]) as reader:
        assert {c.topic: c.msgcount for c in reader.connections} == counts
        assert sum(1 for _ in reader.messages()) == sum(counts.values())
    with file.open('rb') as stream:
        reader = make_reader(stream, validate_crcs=True)
        statistics = reader.get_summary().statistics
        times = [message.log_time for _, _, message in reader.iter_messages()]
        names = [record.name for record in reader.iter_metadata()]
    assert times == sorted(times)
    assert len(times) == statistics.message_count == sum(counts.values())
    assert sorted(names) == ['klann_ros.loss', 'klann_ros.solver', 'rosbag2']
    with file.open('rb') as stream:
        # It takes the records as they stand in the file.
        assert len(list(NonSeekingReader(stream).iter_messages())) == len(times)
    metadata = yaml.safe_load((file.parent / 'metadata.yaml').read_text(encoding='utf-8'))
    information = metadata['rosbag2_bagfile_information']
    assert information['message_count'] == len(times)
    assert information['relative_file_paths'] == [file.name]
    recovery = recover(file.parent, tmp_path / 'recovered')
    assert (recovery.messages, recovery.lost) == (len(times), [])


@pytest.mark.parametrize(('storage', 'mode'), KINDS, ids=NAMES)
def test_every_kind_of_bag_is_annotated(
    faulty: Path, tmp_path: Path, storage: Any, mode: Any
) -> None:
    bag = convert(faulty, tmp_path / 'bag', storage, mode)
    geometry = tmp_path / 'leg.yaml'
    geometry.write_text(yaml.safe_dump(KlannGeometry.sem104().as_dict()), encoding='utf-8')
    arguments = ['--geometry', str(geometry), '--annotate', str(tmp_path / 'out')]
    assert main([str(bag), *arguments]) == 1
    recorded = without_annotations(tmp_path / 'out')
    # Name, log time and bytes: a bag has no numbers and no source times.
    assert [m[:2] + m[4:] for m in recorded] == [m[:2] + m[4:] for m in messages(bag)]
    assert sum(m[0] == ANNOTATIONS[1] for m in messages(tmp_path / 'out')) == 400


def test_a_damaged_run_and_one_without_messages_are_annotated(
    faulty: Path, tmp_path: Path, make_script: Any, make_run: Any, write_messages: Any
) -> None:
    faulty = write_messages(faulty, write_messages.read(faulty), chunk_size=2000)
    (file,) = faulty.glob('*.mcap')
    data = file.read_bytes()
    # Killed: without the summary, and in the middle of a chunk.
    file.write_bytes(data[: len(data) // 2])
    copy = annotated(faulty, tmp_path / 'out').parent
    assert without_annotations(copy) == messages(faulty)
    assert {message[0] for message in messages(copy)} >= {*ANNOTATIONS}
    script = make_script()
    script.answers.clear()
    empty = make_run(script, 'empty')
    copy = annotated(empty, tmp_path / 'out_of_empty')
    assert {message[0] for message in messages(copy.parent)} <= {ANNOTATIONS[0]}


def test_existing_files_and_the_input_are_refused_as_output(
    faulty: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = messages(faulty)
    copy = annotated(faulty, tmp_path / 'out').parent
    (tmp_path / 'dangling').symlink_to(tmp_path / 'nowhere')
    capsys.readouterr()
    for run, output, reason in (
        (faulty, copy, 'exists already'),
        (faulty, faulty, 'exists already'),
        (faulty, faulty / 'in_it', 'which is only read'),
        (faulty, tmp_path / 'dangling', 'exists already'),
        (copy, tmp_path / 'twice', '/review/findings is in the log already'),
    ):
        assert main([str(run), '--annotate', str(output)]) == 3
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith('review: --annotate ')
        assert reason in line
    assert messages(faulty) == before
    assert not (tmp_path / 'twice').exists()
    with pytest.raises(SystemExit):
        main([str(faulty), str(copy), '--annotate', str(tmp_path / 'two')])
    assert '--annotate takes one run' in capsys.readouterr().err


def test_the_angles_of_all_legs_are_one_message_in_the_order_of_time(tmp_path: Path) -> None:
    names = ['left', 'right']
    parameters = {**KlannGeometry().as_dict(), 'legs': names}
    run = LegRun({name: KlannLeg() for name in names}, {'right': 1.0}, parameters)
    file = annotated(run.write(tmp_path / 'run'), tmp_path / 'out')
    states = defaultdict(list)
    with file.open('rb') as stream:
        reader = NonSeekingReader(stream, decoder_factories=[DecoderFactory()])
        # As they stand in the file.
        for _, channel, message, state in reader.iter_decoded_messages(log_time_order=False):
            states[channel.topic].append((message.log_time, state))
    both = zip(states['/joint_states'], states[ANNOTATIONS[1]], strict=True)
    for (time, recorded), (right_time, right) in both:
        assert (right_time, right.name) == (time, recorded.name)
        np.testing.assert_allclose(right.position, recorded.position, atol=1e-12)


def test_poses_that_are_not_kept_are_solved_again(faulty: Path, tmp_path: Path) -> None:
    copy = annotated(faulty, tmp_path / 'copy').parent
    annotate(review_run(faulty), str(tmp_path / 'again'))
    assert messages(tmp_path / 'again') == messages(copy)


def test_a_full_disk_leaves_no_half_copy(faulty: Path, tmp_path: Path) -> None:
    (file,) = faulty.glob('*.mcap')
    # As a full disk does, these let a file grow no further: before and after the run's bytes.
    for limit in (file.stat().st_size // 2, file.stat().st_size + 500):
        code = f'import resource as r; r.setrlimit(r.RLIMIT_FSIZE, ({limit}, {limit}))\n'
        code += 'import sys; from klann_ros.executables import review; sys.exit(review())'
        done = called(PYTHON, '-c', code, faulty, '--annotate', tmp_path / 'copy')
        reason = f'--annotate {tmp_path}/copy cannot be written: File too large'
        assert (done.returncode, done.stderr) == (3, f'review: {reason}\n')
        assert not (tmp_path / 'copy').exists()


@pytest.mark.parametrize('time', [AFTER_2038, 2**62 + 1, 2**64 - 1])
def test_a_log_after_2038_is_annotated_with_the_last_stamp(tmp_path: Path, time: int) -> None:
    run = tmp_path / 'run'
    with RunWriter(run) as writer:
        writer.write(
            Message(Topic('/crank_angle', 'std_msgs/msg/Float64'), bytes(12), time, time, 1)
        )
    (finding,) = decoded_by_topic(annotated(run, tmp_path / 'out'))['/review/findings'].values()
    assert finding.status[0].name == 'review: poses'
    assert finding.header.stamp.sec == 2**31 - 1


def test_an_impossible_log_time_is_kept_beside_the_annotations(
    make_script: Any, make_run: Any, tmp_path: Path
) -> None:
    script = make_script()
    script.misdate('/crank_angle', 200, 201, 2**64 - 5 * 10**9)
    run = make_run(script)
    out = annotated(run, tmp_path / 'out').parent
    assert without_annotations(out) == messages(run)
    with open_log(run) as log, open_log(out) as annotated_log:
        assert annotated_log.start_time == log.start_time


def test_an_output_with_the_name_of_a_file_is_a_folder_and_is_named(
    faulty: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / 'out.mcap'
    assert annotated(faulty, out) == out / 'out.mcap_0.mcap'
    assert capsys.readouterr().err == f'review: the annotated run is the folder {out}\n'
