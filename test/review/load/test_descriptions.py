"""The geometry from robot_description, from a name, or none: the report names its source."""

from dataclasses import replace
import json
from pathlib import Path
from typing import Any

from bags import text
from findings import checks, found
from klann_ros.kinematics import KlannGeometry, KlannLeg, LinkageLeg, shipped_linkages
from klann_ros.log.definitions import definition
from klann_ros.log.records import Message, Topic
from klann_ros.log.run_parameters import leg_description, SolverParameters
from klann_ros.review.command import main
from klann_ros.review.reviewing import review_run
from klann_ros.robot import robot_of, RobotFileError
from leg_runs import LegRun, START
import pytest
from rosbag2_bags import convert, write_bag
from rosbags.rosbag2 import CompressionMode, StoragePlugin
from xacro_legs import ROOT, urdf_of

PATENT = urdf_of(ROOT / 'config' / 'patent.yaml')
STRING, FLOAT = 'std_msgs/msg/String', 'std_msgs/msg/Float64'
URDF = (ROOT / 'urdf' / 'klann.urdf').read_text(encoding='utf-8')
WALKER = (ROOT / 'urdf' / 'walker4.urdf').read_text(encoding='utf-8')


@pytest.fixture
def described_run(make_script: Any) -> Any:
    """Return what makes runs whose only geometry is in robot descriptions."""

    def make(
        *descriptions: str,
        geometry: KlannGeometry | None = None,
        topic: str = '/robot_description',
        every: float = 1.0,
    ) -> Any:
        script = make_script(geometry)
        script.geometry = None
        for n, words in enumerate(descriptions):
            time = START + round(n * every * 1e9)
            latched = Topic(topic, STRING, definition(STRING))
            script.messages.append(Message(latched, text(words), time + 1000, time, n + 1))
        return script

    return make


def source(run: Path) -> str:
    (leg,) = review_run(run).legs
    return str(leg.recording.solver.source)


def test_a_robot_description_has_the_geometry(described_run, make_run, capsys, tmp_path) -> None:
    run, report = make_run(described_run(URDF)), tmp_path / 'report.json'
    assert main([str(run), '--json', str(report)]) == 0
    origin = '/robot_description, assembly mode from its poses'
    output = capsys.readouterr().out
    assert f'the geometry is that of {origin}\n' in output
    assert 'nothing found: every pose is the right one' in output
    assert json.loads(report.read_text())['legs'][0]['geometry_source'] == origin


def test_a_leg_put_together_the_other_way_is_taken_as_its_poses_are(
    described_run, make_run
) -> None:
    script = described_run(PATENT, geometry=KlannGeometry.patent())
    review = review_run(make_run(script))
    assert checks(review) == []
    assert review.legs[0].recording.solver.leg.geometry == KlannGeometry.patent()


def test_a_wrong_pose_and_a_flipped_one_are_found_all_the_same(described_run, make_run) -> None:
    script = described_run(URDF)
    script.answers[100].pose[2] += 1e-3
    other = KlannLeg(KlannGeometry(assembly=(1, -1))).solve(script.answers[200].alpha)
    script.change(200, pose=list(other.joints), foot=other.h)
    assert checks(review_run(make_run(script))) == ['closure', 'branch']


def test_a_bag_of_another_recorder_is_judged(described_run, make_run, tmp_path) -> None:
    run = make_run(described_run(URDF).by_crank_state())
    bag = convert(run, tmp_path / 'bag', StoragePlugin.MCAP, CompressionMode.NONE)
    review = review_run(bag)
    assert checks(review) == []
    assert len(review.legs[0].evaluated.poses) == 400


def test_a_walker_is_judged_without_its_phases(tmp_path, write_messages) -> None:
    names = ('front_left', 'front_right', 'rear_left', 'rear_right')
    phases = {name: 0.1 + n for n, name in enumerate(names)}
    run = LegRun({name: KlannLeg() for name in names}, phases).write(tmp_path / 'run')
    messages = write_messages.read(run)
    # The crank's own angle, which is none of its legs'.
    asked = Topic('/crank_angle', FLOAT, definition(FLOAT))
    cranks = [
        replace(m, topic=asked, data=bytes([0, 1, 0, 0]) + bytes(8))
        for m in messages
        if m.topic.name == '/joint_states'
    ]
    latched = Topic('/robot_description', STRING, definition(STRING))
    first = Message(latched, text(WALKER), START, START, 1)
    both = sorted([first, *messages, *cranks], key=lambda m: m.log_time)
    review = review_run(write_messages(run, both))
    evaluated = {leg.recording.title: len(leg.evaluated.poses) for leg in review.legs}
    assert evaluated == dict.fromkeys(names, 400)
    assert checks(review) == []


def test_one_description_is_that_of_all_namespaces(described_run, make_run) -> None:
    script = described_run(URDF).in_namespace('/left')
    assert source(make_run(script)).startswith('/robot_description')


def test_of_two_descriptions_the_own_one_counts(described_run, make_run) -> None:
    script = described_run(URDF, topic='/left/robot_description').in_namespace('/left')
    other = described_run(PATENT, topic='/right/robot_description')
    script.messages += other.messages
    assert source(make_run(script)).startswith('/left/robot_description')
    assert found(make_run(script, 'again')) == []


def test_only_poses_after_a_new_description_are_checked(described_run, make_run) -> None:
    longer = URDF.replace('0.43 0 0', '0.44 0 0')
    script = described_run(longer, URDF)
    for n, answer in enumerate(described_run(geometry=KlannGeometry(l_gh=0.44)).answers[:200]):
        script.answers[n] = answer
    (leg,) = (review := review_run(make_run(script))).legs
    assert checks(review) == []
    assert len(leg.evaluated.poses) == 200


def test_a_repeated_description_is_not_a_change(described_run, make_run) -> None:
    (leg,) = review_run(make_run(described_run(URDF, URDF, URDF, every=0.5))).legs
    assert len(leg.evaluated.poses) == 400


HOSTILE = '<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa">]>' + URDF


@pytest.mark.parametrize('words', ['', 'x' * 70_000, HOSTILE, '<robot name="arm"/>'])
def test_a_description_of_another_robot_gives_no_geometry(described_run, make_run, words) -> None:
    assert found(make_run(described_run(words))) == [
        'geometry: the run does not contain the geometry'
    ]


def test_an_unreadable_description_gives_no_geometry(described_run, make_run) -> None:
    script = described_run(URDF)
    script.messages = [replace(m, data=m.data[:9]) for m in script.messages]
    assert checks(review_run(make_run(script))) == ['geometry']


def test_the_solvers_record_comes_first(healthy, described_run, make_run) -> None:
    healthy.messages = described_run(PATENT).messages
    run = make_run(healthy)
    assert source(run) == 'the parameters of /solver_node'
    assert found(run) == []


def test_a_leg_that_is_given_comes_before_all(described_run, make_run, capsys) -> None:
    run = make_run(described_run(URDF))
    assert main([str(run), '--geometry', 'patent']) == 1
    output = capsys.readouterr().out
    assert 'the geometry is that of --geometry\n' in output
    assert 'ERROR closure: 400 of 400 poses' in output


def test_a_leg_is_given_by_its_name(described_run, make_run) -> None:
    assert main([str(make_run(described_run())), '--geometry', 'sem104']) == 0


def test_a_file_comes_before_a_name(tmp_path, monkeypatch) -> None:
    (tmp_path / 'patent').write_text('l_gh: 0.44')
    monkeypatch.chdir(tmp_path)
    assert robot_of('patent').legs[0].linkage == KlannGeometry(l_gh=0.44).linkage


def test_an_unknown_name_lists_the_known_ones(capsys) -> None:
    with pytest.raises(RobotFileError) as error:
        robot_of('sem140')
    names = ', '.join(('sem104', 'patent', *shipped_linkages()))
    assert (
        str(error.value)
        == f'sem140 cannot be read: No such file or directory; shipped are {names}'
    )
    assert main(['nothing', '--geometry', 'sem140']) == 2
    assert capsys.readouterr().err == f'review: {error.value}\n'


def test_the_hint_and_the_help_list_shipped_linkages(described_run, make_run, capsys) -> None:
    names = ('sem104', 'patent', *shipped_linkages())
    main([str(make_run(described_run()))])
    hint = f'or one of {", ".join(names)}'
    assert f'give the leg by --geometry FILE, {hint}\n' in capsys.readouterr().out
    with pytest.raises(SystemExit):
        main(['--help'])
    assert hint in ' '.join(capsys.readouterr().out.split())


def described(parameters: Any, time: int = START) -> Message:
    topic = Topic('/leg_description', STRING, definition(STRING))
    words = leg_description(SolverParameters('/solver_node', time, dict(parameters)))
    return Message(topic, text(words), time, time, 1)


def test_a_bag_of_any_recorder_has_the_geometry_in_leg_description(tmp_path: Path) -> None:
    """A parameter of the solver names a file, which is not opened: its text is in the topic."""
    linkage = (ROOT / 'klann_ros' / 'linkages' / 'jansen.yaml').read_text(encoding='utf-8')
    legs = {'left': LinkageLeg(robot_of('jansen').legs[0].linkage)}
    run = LegRun(legs, {'left': 0.5}, rates=False)
    parameters = {'legs': ['left'], 'left.phase': 0.5, 'linkage_description': linkage}
    # It was discovered late.
    first, *more = run.messages()
    kind = StoragePlugin.SQLITE3, CompressionMode.FILE
    bag = write_bag(tmp_path / 'bag', [first, described(parameters), *more], *kind)
    (leg,) = (review := review_run(bag)).legs
    assert checks(review) == []
    assert leg.recording.solver.source == 'the parameters of /solver_node'
    assert leg.recording.solver.phase == 0.5
    assert len(leg.evaluated.poses) == 400


def test_changed_lengths_in_leg_description_hold_from_then_on(make_script, make_run) -> None:
    script = make_script(KlannGeometry(l_gh=0.44))
    script.geometry = None
    later = make_script()
    for n in range(200, 400):
        script.answers[n] = later.answers[n]
    changed = [described({'l_gh': 0.44}), described({'l_gh': 0.43}, START + 1_000_000_000)]
    script.messages += changed
    (leg,) = (review := review_run(make_run(script))).legs
    assert checks(review) == []
    assert len(leg.evaluated.poses) == 200


@pytest.mark.parametrize(
    'words',
    [
        '',
        '[',
        '7',
        '{}',
        '/s: {}',
        '/s: {ros__parameters: 7}',
        '/s: {ros__parameters: {l_ab: .inf}}',
        '/s: {ros__parameters: {l_ab: &a [*a]}}',
        '/s: {ros__parameters: {l_ab: 2026-11-24}}',
        '/s: {ros__parameters: {? [a] : 1}}',
        '/s: {ros__parameters: {l_ab: !!python/object/apply:os.system [ls]}}',
        '/s: {ros__parameters: {linkage: /dev/zero}}',
        '/s: {ros__parameters: {l_ab: -1}}',
        '[' * 10_000,
    ],
)
def test_hostile_leg_descriptions_give_no_leg(words: str, make_script, make_run) -> None:
    script = make_script()
    script.geometry = None
    topic = Topic('/leg_description', STRING, definition(STRING))
    script.messages.append(Message(topic, text(words), START, START, 1))
    assert 'geometry' in checks(review_run(make_run(script)))
