"""The geometry from robot_description, from a name, or none: the report names its source."""

from dataclasses import replace
from pathlib import Path

from klann_ros.kinematics import KlannGeometry, KlannLeg, LinkageLeg, shipped_linkages
from klann_ros.log.records import Message
from klann_ros.log.run_parameters import leg_description, SolverParameters
from klann_ros.review.command import main
from klann_ros.review.reviewing import review_run
from klann_ros.robot import robot_of, RobotFileError
from leg_runs import LegRun, START, topic_of
from playable_logs import text
import pytest
from review_findings import checks, found as findings_of
from rosbag2_bags import write_bag
from rosbags.rosbag2 import CompressionMode, StoragePlugin
from xacro_legs import ROOT

STRING, FLOAT = 'std_msgs/msg/String', 'std_msgs/msg/Float64'
WALKER = (ROOT / 'urdf' / 'walker4.urdf').read_text(encoding='utf-8')


def test_a_robot_description_is_the_source_of_the_geometry(healthy, printed) -> None:
    healthy.geometry = None
    healthy.describe('klann')
    output = printed(healthy)
    origin = '/robot_description, assembly mode from its poses'
    assert f'the geometry is that of {origin}\n' in output
    assert 'nothing found: every pose is the right one' in output


def test_a_walker_is_judged_without_its_phases(tmp_path, write_messages) -> None:
    names = ('front_left', 'front_right', 'rear_left', 'rear_right')
    phases = {name: 0.1 + n for n, name in enumerate(names)}
    run = LegRun({name: KlannLeg() for name in names}, phases).write(tmp_path / 'run')
    messages = write_messages.read(run)
    # The crank's own angle, which is none of its legs'.
    crank = topic_of('/crank_angle', FLOAT)
    for message in [*messages]:
        if message.topic.name == '/joint_states':
            messages.append(replace(message, topic=crank, data=bytes([0, 1, 0, 0]) + bytes(8)))
    described = Message(topic_of('/robot_description', STRING), text(WALKER), START, START, 1)
    messages = sorted([described, *messages], key=lambda message: message.log_time)
    review = review_run(write_messages(run, messages))
    evaluated = {leg.recording.title: len(leg.evaluated.poses) for leg in review.legs}
    assert evaluated == dict.fromkeys(names, 400)
    assert checks(review) == []


def test_a_leg_that_is_given_comes_before_all(healthy, printed) -> None:
    healthy.geometry = None
    healthy.describe('klann')
    output = printed(healthy, '--geometry', 'patent', code=1)
    assert 'the geometry is that of --geometry\n' in output
    assert 'ERROR closure: 400 of 400 poses' in output


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


def test_the_hint_and_the_help_list_shipped_linkages(healthy, make_run, capsys) -> None:
    healthy.geometry = None
    run = str(make_run(healthy))
    hint = f'or one of {", ".join(("sem104", "patent", *shipped_linkages()))}'
    assert main([run]) == 1
    assert f'give the leg by --geometry FILE, {hint}\n' in capsys.readouterr().out
    assert main([run, '--geometry', 'sem104']) == 0
    with pytest.raises(SystemExit):
        main(['--help'])
    assert hint in ' '.join(capsys.readouterr().out.split())


def test_a_bag_of_any_recorder_has_the_geometry_in_leg_description(tmp_path: Path) -> None:
    """A parameter of the solver names a file, which is not opened: its text is in the topic."""
    linkage = (ROOT / 'klann_ros' / 'linkages' / 'jansen.yaml').read_text(encoding='utf-8')
    legs = {'left': LinkageLeg(robot_of('jansen').legs[0].linkage)}
    run = LegRun(legs, {'left': 0.5}, rates=False)
    parameters = {'legs': ['left'], 'left.phase': 0.5, 'linkage_description': linkage}
    words = leg_description(SolverParameters('/solver_node', START, parameters))
    described = Message(topic_of('/leg_description', STRING), text(words), START, START, 1)
    # It was discovered late.
    first, *more = run.messages()
    kind = StoragePlugin.SQLITE3, CompressionMode.FILE
    bag = write_bag(tmp_path / 'bag', [first, described, *more], *kind)
    (leg,) = (review := review_run(bag)).legs
    assert checks(review) == []
    assert leg.recording.solver.source == 'the parameters of /solver_node'
    assert leg.recording.solver.phase == 0.5
    assert len(leg.evaluated.poses) == 400


HOSTILE = [
    f'/s: {{ros__parameters: {{phase: 1{"0" * 400}}}}}',
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
]


def test_hostile_leg_descriptions_give_no_leg_and_a_reason(healthy, make_run) -> None:
    healthy.geometry = None
    topic = topic_of('/leg_description', STRING)
    healthy.messages += [
        Message(topic, text(words), START + n, START + n, n) for n, words in enumerate(HOSTILE)
    ]
    *refusals, missing = findings_of(make_run(healthy))
    prefix = 'geometry: /leg_description is refused: it is not a leg_description:'
    assert refusals[0].startswith(f'{prefix} line 1, column 31: 1000')
    assert refusals[0].endswith('(401 characters) is no whole number within +-1.8e308')
    assert [refusal.startswith(prefix) for refusal in refusals] == [True, True, True]
    assert missing.startswith('geometry: ')
