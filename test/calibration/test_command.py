"""What `calibrate` reads, writes, refuses, and returns."""

import fcntl
from html import unescape
import json
import os
from pathlib import Path
import re
import resource
import signal
import subprocess
import sys
import time
from typing import Any

from klann_ros.calibration.command import main
from klann_ros.calibration.load import Request
from klann_ros.calibration.tables import load_table, TableOptions
from klann_ros.datasheet.command import main as describe
from klann_ros.export.command import main as export
from klann_ros.kinematics import LinkageLeg, shipped_linkage
from klann_ros.robot import robot_of
from klann_ros.sanitize.yaml_text import parse
from measured_robots import crank_topic, points_topic, Robot, write_run
import numpy as np
from point_files import point_file
import pytest

ROBOT = Robot(count=400, period=0.0125)
CODE = 'import sys; from klann_ros.executables import calibrate; print("ready", flush=True); '
CODE += 'sys.exit(calibrate())'
POINT = 'geometry_msgs/msg/PointStamped'
Capture = pytest.CaptureFixture[str]


@pytest.fixture(scope='module')
def leg_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a run with a measured point of each type, and what a solver computed of it."""
    state, (_, angles) = 'sensor_msgs/msg/JointState', crank_topic(ROBOT)
    joints = dict.fromkeys(['alpha', 'gamma', 'beta', 'delta', 'theta'], 0.5)
    times = ROBOT.times.tolist()
    thetas = ROBOT.angle('theta')[:, 0]
    topics: dict[str, Any] = {
        '/crank_state': (state, angles),
        '/mocap/foot': points_topic(ROBOT, 'H'),
        '/mocap/knee': points_topic(ROBOT, 'G', 'geometry_msgs/msg/PoseStamped'),
        '/vicon/f': points_topic(ROBOT, 'F', 'geometry_msgs/msg/PoseWithCovarianceStamped'),
        '/vicon/c': points_topic(ROBOT, 'C', 'geometry_msgs/msg/TransformStamped'),
        '/tf': points_topic(ROBOT, 'G', 'tf2_msgs/msg/TFMessage'),
        '/tags': points_topic(ROBOT, 'H', 'visualization_msgs/msg/Marker'),
        '/encoder2': (state, [*zip(times, [{'theta': x} for x in thetas], strict=True)]),
        '/point_h': points_topic(ROBOT, 'H'),
        '/joint_states': (state, [(t, joints) for t in times]),
        '/mm': (POINT, [(t, 1e3 * np.array(h)) for t, h in points_topic(ROBOT, 'H')[1]]),
    }  # fmt: skip
    return write_run(tmp_path_factory.mktemp('runs') / 'run', topics)


@pytest.fixture(scope='module')
def table(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the same as a CSV file, with empty fields."""
    file = tmp_path_factory.mktemp('tables') / 'run.csv'
    columns = np.column_stack([ROBOT.times, ROBOT.crank, ROBOT.seen('H'), ROBOT.seen('G')])
    rows = [','.join(map(repr, row)) for row in columns.tolist()]
    rows[7] = rows[7].rsplit(',', 2)[0] + ',,'
    file.write_text('\n'.join(['time,crank,H.x,H.y,G.x,G.y', *rows]))
    return file


def test_every_program_takes_the_leg_file(leg_run: Path, tmp_path: Path, capsys: Capture) -> None:
    built, page, numbers = (tmp_path / name for name in ('built.yaml', 'c.html', 'c.json'))
    asked = [
        str(leg_run),
        '--leg',
        'sem104',
        '--point',
        'H=/mocap/foot',
        '--point',
        'G=/mocap/knee',
    ]
    assert main([*asked, '-o', str(built), '--html', str(page), '--json', str(numbers)]) == 0
    printed = capsys.readouterr().out
    assert 'All 14 parameters can be told apart' in printed
    assert max(map(len, printed.splitlines())) <= 110
    content = json.loads(numbers.read_text())
    true = ROBOT.linkage.dimensions
    for name, dimension in content['dimensions'].items():
        assert abs(dimension['value'] - true[name]) < 5.0 * dimension['standard_error']
    assert content['phase']['value'] == pytest.approx(ROBOT.phase, abs=5e-4)
    assert content['points']['H']['used'] == 400
    assert content['unobservable'] == []
    assert len(content['correlation']) == len(content['parameters']) == 14
    leg = robot_of(str(built)).legs[0]
    assert leg.phase == pytest.approx(content['phase']['value'], abs=1e-8)
    assert leg.masses is not None
    for name, length in leg.linkage.dimensions.items():
        assert length == pytest.approx(content['dimensions'][name]['value'], abs=1e-8)
    assert describe([str(built)]) == 0
    assert export([str(built), '--urdf', str(tmp_path / 'leg.urdf')]) == 0
    text = page.read_text()
    assert text.startswith('<!doctype html>')
    # The residuals are lines, and the leg file has the file's own lines.
    curves = re.findall(r'<path d="M([^"]*)" class="curve colour-\d[ "]', text)
    assert sum(curve.count('L') > 60 for curve in curves) >= 4
    assert unescape(text.partition('<pre>')[2].partition('</pre>')[0]) == built.read_text()
    assert '<script' not in text
    assert 'Ellipses: 95 %' in text
    # The result is first; what specialists read is closed where all is observable.
    assert text.index('as built</h2>') < text.index('<details><summary>Observability')


POINTS = [
    'F=/vicon/f',
    'C=/vicon/c',
    'G=/tf:marker',
    'H=/tags',
    'H=/tags:marker/7',
    'H=mocap/foot',
]


@pytest.mark.slow
@pytest.mark.parametrize('point', POINTS)
def test_every_type_of_measured_point_is_read(leg_run: Path, tmp_path: Path, point: str) -> None:
    numbers = tmp_path / 'c.json'
    asked = [
        str(leg_run),
        '--leg',
        'sem104',
        '--point',
        point,
        '--angle',
        'theta=/encoder2:theta',
    ]
    assert main([*asked, '--json', str(numbers)]) in {0, 1}
    used_point = json.loads(numbers.read_text())['points'][point.partition('=')[0]]
    assert used_point['used'] > 390
    assert used_point['rms_built'] == pytest.approx(1e-4, rel=0.15)


def test_a_run_of_the_solver_needs_no_option(tmp_path: Path, capsys: Capture) -> None:
    points = {f'/mocap/{name}': points_topic(ROBOT, name.upper()) for name in 'hg'}
    crank = {'/crank_state': crank_topic(ROBOT)}
    solver_run = write_run(tmp_path / 'run', crank | points, {'l_ab': 0.12})
    numbers = tmp_path / 'c.json'
    assert main([str(solver_run), '--json', str(numbers)]) == 0
    assert set(json.loads(numbers.read_text())['points']) == {'H', 'G'}
    run_without_leg = write_run(tmp_path / 'other', crank | points)
    assert main([str(run_without_leg)]) == 2
    assert 'name its file with --leg' in capsys.readouterr().err
    run_without_points = write_run(tmp_path / 'none', crank)
    assert main([str(run_without_points), '--leg', 'sem104']) == 2
    assert 'no topic has the name of a point, as /mocap/h' in capsys.readouterr().err


def test_the_covariance_of_a_pose_is_the_stated_noise(leg_run: Path, tmp_path: Path) -> None:
    numbers = tmp_path / 'c.json'
    asked = [str(leg_run), '--leg', 'sem104', '--point', 'F=/vicon/f', '--json', str(numbers)]
    assert main(asked) == 1
    assert json.loads(numbers.read_text())['chi2_dof'] == pytest.approx(1.0, abs=0.15)


def test_a_table_is_read_whole(table: Path, tmp_path: Path) -> None:
    numbers = tmp_path / 'c.json'
    assert main([str(table), '--leg', 'sem104', '--json', str(numbers)]) == 0
    points = json.loads(numbers.read_text())['points']
    assert (points['H']['used'], points['G']['used'], points['G']['skipped']) == (400, 399, 1)
    leg = robot_of('sem104').legs[0]
    (renamed,) = load_table(str(table), leg, [Request('H', 'G')], TableOptions()).measured
    assert renamed.name == 'H'
    np.testing.assert_array_equal(renamed.values, np.delete(ROBOT.seen('G'), 7, axis=0))


def test_a_linkage_file_keeps_its_units(table: Path, tmp_path: Path) -> None:
    built = tmp_path / 'built.yaml'
    assert main([str(table), '--leg', 'klann', '-o', str(built)]) in {0, 1}
    leg = robot_of(str(built)).legs[0]
    assert leg.linkage.name == 'Klann leg'
    assert 'length: mm' in leg.description
    true = ROBOT.linkage.dimensions['l_gh']
    assert leg.linkage.dimensions['G-H'] == pytest.approx(true, abs=1e-4)
    assert describe([str(built)]) == 0


def test_a_linkage_by_points_is_calibrated(table: Path, tmp_path: Path) -> None:
    drawing = tmp_path / 'points.yaml'
    drawing.write_text(point_file(LinkageLeg(shipped_linkage('klann')).solve(1.0)))
    built = tmp_path / 'built.yaml'
    assert main([str(table), '--leg', str(drawing), '-o', str(built)]) in {0, 1}
    leg = robot_of(str(built)).legs[0]
    assert parse(leg.description).keys() >= {'pivots', 'bodies', 'assembly'}
    expected = LinkageLeg(ROBOT.linkage).solve(2.0).h
    assert LinkageLeg(leg.linkage).solve(2.0).h == pytest.approx(expected, abs=1e-4)


def test_a_prior_makes_every_number_known(table: Path, tmp_path: Path, capsys: Capture) -> None:
    foot = [str(table), '--leg', 'sem104', '--point', 'H=H', '--camera', 'unknown']
    assert main(foot) == 1
    printed = capsys.readouterr().out
    assert 'unobservable: ' in printed
    assert "with the camera's pose: resolves all" in printed
    assert main([*foot, '--prior', '0.5']) == 0
    prior = tmp_path / 'tolerance.yaml'
    prior.write_text('{l_ab: 0.0001, x_d: 0.0001, y_a: 0.0001, x_e: 0.0001, y_e: 0.0001}')
    assert main([*foot, '--prior', str(prior)]) == 0


@pytest.mark.parametrize(
    ('arguments', 'reason'),
    [
        ('--point H=/point_h', 'is no measurement: a solver computed it'),
        ('--angle theta=/joint_states:theta', 'is no measurement: a solver computed it'),
        ('--point H=/nowhere', 'there is no topic /nowhere in the run'),
        ('--point Q=/mocap/foot', 'Q is no point and no angle of the leg'),
        ('--point H=/encoder2', 'a measured point is PointStamped, PoseStamped'),
        ('--point H=/mm', 'is it in millimetres'),
        ('--point H=/tf', 'has several: name one as H=/tf:NAME'),
        ('--point H=/tf:nobody', 'nobody is not on /tf; there are marker, other'),
        ('--point H=/mocap/knee', 'fit only a leg with l_gh = '),
        ('--point H', 'must be NAME=TOPIC'),
        ('--point H=/mocap/foot --prior -1', 'it must be millimetres'),
        ('--point H=/mocap/foot --prior /nowhere.yaml', 'No such file'),
        ('--point H=/mocap/foot --crank /mocap/knee', 'no crank angle of the joint crank'),
        ('--point H=/mocap/foot --leg-name front', 'name the leg with --leg-name'),
    ],
)
def test_bad_input_is_refused(leg_run: Path, capsys: Capture, arguments: str, reason: str) -> None:
    try:
        code = main([str(leg_run), '--leg', 'sem104', *arguments.split()])
    except SystemExit as end:
        code = int(end.code or 0)
    assert code == 2
    line = capsys.readouterr().err.strip().splitlines()[-1]
    assert reason in line


@pytest.mark.parametrize('option', ['-o', '--html', '--json'])
def test_an_unwritable_output_is_one_line(
    leg_run: Path, tmp_path: Path, capsys: Capture, option: str
) -> None:
    kept = tmp_path / 'kept'
    link = tmp_path / 'link'
    kept.write_text('precious')
    link.symlink_to(kept)
    foot = [str(leg_run), '--leg', 'sem104', '--point', 'H=/mocap/foot']
    for place in (link, Path('/dev/full'), tmp_path / 'missing' / 'file'):
        # Of two -o the last counts.
        assert main([*foot, '-o', str(tmp_path / 'built.yaml'), option, str(place)]) == 3
        (line,) = capsys.readouterr().err.splitlines()
        assert str(place) in line
    assert kept.read_text() == 'precious'


def test_a_full_disk_leaves_the_old_leg_file(table: Path, tmp_path: Path, capsys: Capture) -> None:
    built = tmp_path / 'built.yaml'
    built.write_text('# by hand')
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, limits[1]))
    try:
        assert main([str(table), '--leg', 'sem104', '-o', str(built)]) == 3
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    (line,) = capsys.readouterr().err.splitlines()
    assert 'built.yaml cannot be written: File too large' in line
    assert {file.name: file.read_text() for file in tmp_path.iterdir()} == {
        'built.yaml': '# by hand'
    }


@pytest.mark.slow
@pytest.mark.parametrize(
    ('number', 'code', 'stage'), [(signal.SIGINT, 130, 'fit'), (signal.SIGTERM, 143, 'page')]
)
def test_a_signal_leaves_whole_files(
    table: Path, tmp_path: Path, number: int, code: int, stage: str
) -> None:
    built, page, pipe = (tmp_path / name for name in ('built.yaml', 'c.html', 'pipe'))
    # Nothing reads from the pipe, so the process waits at the last of its files.
    os.mkfifo(pipe)
    reader = os.open(pipe, os.O_RDONLY | os.O_NONBLOCK)
    fcntl.fcntl(reader, fcntl.F_SETPIPE_SZ, 4096)
    files = ['-o', str(built), '--html', str(page), '--json', str(pipe)]
    process = subprocess.Popen(
        [sys.executable, '-c', CODE, str(table), '--leg', 'sem104', *files],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == 'ready\n'
    time.sleep(0.2)
    while stage == 'page' and not built.exists():
        time.sleep(0.001)
    process.send_signal(number)
    _, error = process.communicate(timeout=60.0)
    os.close(reader)
    assert (process.returncode, error) == (code, '')
    # A file is beside its place until it is whole.
    assert {file.name for file in tmp_path.iterdir()} <= {'built.yaml', 'c.html', 'pipe'}
    assert built.exists() == (stage == 'page')
    if built.exists():
        assert robot_of(str(built)).legs
    assert not page.exists() or page.read_text().endswith('</html>\n')


def test_hostile_names_in_a_run_are_escaped(tmp_path: Path, capsys: Capture) -> None:
    topics = {'/crank_state': crank_topic(ROBOT), '/\x1b[31mred': points_topic(ROBOT, 'H')}
    folder = write_run(tmp_path / 'run', topics)
    assert main([str(folder), '--leg', 'sem104', '--point', 'H=/red']) == 2
    assert '\x1b' not in capsys.readouterr().err
