"""A URDF with the loop_closures.yaml of scikit-robot or robonex becomes a linkage that moves."""

from cmath import phase
from itertools import islice
from pathlib import Path

from klann_ros.importing.command import main
from klann_ros.kinematics import linkage_from_file, LinkageLeg
from natural_coordinates import NaturalCoordinates, read_rows
import pytest
from yaml_tables import read_table


def joint(name: str, ends: str, xyz: str, kind: str = 'revolute', more: str = '') -> str:
    """Return a joint of a URDF about y; `ends` are its parent and its child."""
    parent, child = ends.split()
    axis = '' if 'axis' in more else '<axis xyz="0 -1 0"/>'
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}"/>{axis}{more}</joint>'
    )


# The left knee of Humanoid-Project/robonex-description: urdf/robonex.urdf, loop_closures.yaml.
KNEE = '\n'.join(
    [
        joint('knee', 'thigh shin', '-0.0348 -0.0255 -0.34'),
        joint('motor', 'thigh crank', '-0.0348 -0.032 -0.255'),
        joint('pin', 'crank coupler', '0.042262 0.021 0.090631'),
        joint('ankle', 'shin foot', '0 0 -0.37', 'fixed'),
    ]
)
KNEE_LOOPS = """\
pin_loops:
  - name: close
    parent: coupler
    child: shin
    parent_xyz: [0.047584, 0.0, -0.125267]
    child_xyz: [0.089846, 0.0145, 0.050364]
    axis: [0.0, 1.0, 0.0]
actuated_joints: [hip, motor]
"""
KNEE_ROWS = """\
-34.8 -340 R ground shin
-34.8 -255 R ground crank!
7.462 -164.369 R crank coupler
55.046 -289.636 R coupler shin"""
# The four-bar of iory/scikit-robot, examples/module_assembly_four_bar.py, which rocks.
Z = '<axis xyz="0 0 1"/>'
FOUR_BAR = '\n'.join(
    [
        joint('g1', 'ground g1', '0 0 0', 'fixed'),
        joint('g2', 'ground g2', '0.2 0.05 0', 'fixed'),
        joint('first', 'g1 c1', '0 0 0', more=Z),
        joint('second', 'g2 c2', '0 0 0', more=f'{Z}<mimic joint="first"/>'),
        joint('tip', 'c1 c1_tip', '0 0.1 0', 'fixed'),
        joint('third', 'c1_tip cp', '0 0 0', more=Z),
        joint('cp_end', 'cp cp_tip', '0.2 0 0', 'fixed'),
        joint('c2_end', 'c2 c2_tip', '0 0.05 0', 'fixed'),
    ]
)
FOUR_BAR_LOOPS = """\
closures:
- {link_a: cp_tip, link_b: c2_tip, point: [0.2, 0.1, 0.0], axis: [0.0, 0.0, 1.0]}
dependent: [second, third]
independent: [first]
"""
FOUR_BAR_ROWS = """\
0 0 R ground c1
200 50 R ground c2!
0 100 R c1 cp
200 100 R cp c2"""
FOUR_BAR_NAMES = ('first', 'second', 'third', 'loop1')


def written(folder: Path, joints: str, loops: str | None) -> str:
    """Write a URDF and its loops; return its path."""
    (folder / 'robot.urdf').write_text(f'<?xml version="1.0"?><robot name="r">{joints}</robot>')
    if loops is not None:
        (folder / 'loop_closures.yaml').write_text(loops)
    return str(folder / 'robot.urdf')


@pytest.mark.parametrize(
    ('joints', 'loops', 'rows', 'names', 'options', 'steps'),
    [
        (KNEE, KNEE_LOOPS, KNEE_ROWS, ('knee', 'motor', 'pin', 'close'), [], 30),
        (FOUR_BAR, FOUR_BAR_LOOPS, FOUR_BAR_ROWS, FOUR_BAR_NAMES, ['--crank', 'c2'], 361),
    ],
    ids=['robonex', 'scikit-robot'],
)
def test_a_linkage_of_a_urdf_moves_as_its_joints_do(  # noqa: PLR0917 - columns of a table
    joints: str,
    loops: str,
    rows: str,
    names: tuple[str, ...],
    options: list[str],
    steps: int,
    tmp_path: Path,
) -> None:
    output = tmp_path / 'linkage.yaml'
    assert main([written(tmp_path, joints, loops), '-o', str(output), *options]) == 0
    leg = LinkageLeg(linkage_from_file(output))
    points = read_table(output)['points']
    pivot, pin = leg.linkage.structure.crank.points[:2]
    start = phase(complex(*points[pin]) - complex(*points[pivot]))
    mechanism = NaturalCoordinates(read_rows(rows))
    for rotation, positions in islice(mechanism.turn(360), steps):
        pose = leg.solve(start + rotation)
        places = dict(zip(pose.linkage.structure.points, pose.points, strict=True))
        for name, position in zip(names, positions, strict=True):
            assert abs(1e3 * complex(*places[name]) - position) <= 1e-9 * mechanism.size


# The driven joint hip is in another part of the robot; a frame may have the name of a joint.
@pytest.mark.parametrize(
    ('axis', 'frame', 'foot'), [('0 -1 0', 'hip', 'hip'), ('0 2 0', 'pin', 'pin_frame')]
)
def test_the_crank_is_the_driven_joint_and_the_foot_a_frame(
    axis: str, frame: str, foot: str, tmp_path: Path
) -> None:
    output = tmp_path / 'linkage.yaml'
    joints = KNEE.replace('0 -1 0', axis, 1).replace('"foot"', f'"{frame}"')
    assert main([written(tmp_path, joints, KNEE_LOOPS), '-o', str(output)]) == 0
    table = read_table(output)
    assert table['crank'] == 'crank'
    assert table['foot'] == foot
    assert table['points'][foot] == pytest.approx([-34.8, -710.0])


def test_the_crank_is_the_independent_joint(tmp_path: Path) -> None:
    joints = FOUR_BAR.replace('<mimic joint="first"/>', '')
    loops = FOUR_BAR_LOOPS.replace('[second, third]', '[]').replace('[first]', '[second]')
    output = tmp_path / 'linkage.yaml'
    assert main([written(tmp_path, joints, loops), '-o', str(output)]) == 0
    assert read_table(output)['crank'] == 'c2'


def test_the_plane_and_the_frames_may_have_any_attitude(tmp_path: Path) -> None:
    turned = KNEE.replace('thigh', 'frame') + (
        '<joint name="hip" type="fixed"><parent link="thigh"/><child link="frame"/>'
        '<origin xyz="0.1 -0.2 0.3" rpy="0.3 -0.7 1.1"/></joint>'
    )
    # Its x is down, its y forward, its z to the right.
    coupler = '<origin xyz="0.042262 0.021 0.090631" rpy="1.5707963267949 1.5707963267949 0"/>'
    coupler += '<axis xyz="0 0 1"/>'
    lines = KNEE.splitlines()
    lines[2] = joint('pin', 'crank coupler', '', more=coupler).replace('<origin xyz=""/>', '')
    loops = KNEE_LOOPS.replace('0.047584, 0.0, -0.125267', '0.125267, 0.047584, 0.0')
    loops = loops.replace('[0.0, 1.0, 0.0]', '[0.0, 0.0, -1.0]')
    lengths = []
    for text, closures in ((KNEE, KNEE_LOOPS), (turned, KNEE_LOOPS), ('\n'.join(lines), loops)):
        output = tmp_path / 'linkage.yaml'
        assert main([written(tmp_path, text, closures), '-o', str(output)]) == 0
        points = [complex(*point) for point in read_table(output)['points'].values()]
        lengths.append([abs(a - b) for a in points for b in points])
    assert lengths[1] == pytest.approx(lengths[0])
    assert lengths[2] == pytest.approx(lengths[0])


def test_a_pin_of_three_links_is_one_point(tmp_path: Path) -> None:
    second = '\n'.join(
        [
            joint('other_pin', 'crank other_coupler', '0.042262 0.005 0.090631'),
            joint('pedestal', 'thigh rocker', '-0.15 0 -0.3'),
        ]
    )
    loops = KNEE_LOOPS.replace(
        'actuated',
        """\
  - {name: other, parent: other_coupler, child: rocker, parent_xyz: [-0.1, 0, 0],
     child_xyz: [0.057462, -0.027, 0.135631]}
actuated""",
    ).replace('pin_loops', 'ball_loops')
    output = tmp_path / 'linkage.yaml'
    path = written(tmp_path, f'{KNEE}\n{second}', loops)
    assert main([path, '-o', str(output)]) == 0
    links = read_table(output)['links']
    assert links['coupler'] == ['pin', 'close']
    assert links['other_coupler'] == ['pin', 'other']


def test_a_slider_moves_along_its_axis(tmp_path: Path) -> None:
    slider = '\n'.join(
        [
            joint('motor', 'frame crank', '0 0 0'),
            joint('pin', 'crank rod', '0.03 0 0.04'),
            joint('rail', 'frame piston', '0.12 0 0.01', 'prismatic', '<axis xyz="1 0 0"/>'),
        ]
    )
    loops = 'pin_loops: [{name: wrist, parent: rod, child: piston, parent_xyz: [0.09, 0, -0.03],'
    loops += ' child_xyz: [0, 0, 0], axis: [0, 1, 0]}]'
    output = tmp_path / 'linkage.yaml'
    assert main([written(tmp_path, slider, loops), '-o', str(output), '--foot', 'wrist']) == 0
    leg = LinkageLeg(linkage_from_file(output))
    assert leg.solve(0.0).h == pytest.approx([0.05 + (0.09**2 + 0.03**2 - 0.01**2) ** 0.5, 0.01])


@pytest.mark.parametrize('place', ['../config', 'config', '.'])
def test_the_loops_are_beside_the_urdf_or_in_config(place: str, tmp_path: Path) -> None:
    (tmp_path / 'urdf').mkdir()
    folder = tmp_path / 'urdf' / place
    folder.mkdir(exist_ok=True)
    (folder / 'loop_closures.yaml').write_text(KNEE_LOOPS)
    path = written(tmp_path / 'urdf', KNEE, None)
    assert main([path]) == 0
    # It is not overwritten.
    assert main([path, '-o', str(folder / 'loop_closures.yaml')]) == 3


OTHER_AXIS = KNEE.replace('xyz="0 -1 0"', 'xyz="0 0 1"', 1)
REFUSED = {
    'knee, motor move in different planes': (OTHER_AXIS, KNEE_LOOPS),
    # An axis that is not stated is x.
    'knee, pin move in different planes': (
        KNEE.replace('0.090631"/><axis xyz="0 -1 0"/>', '0.090631"/>'),
        KNEE_LOOPS,
    ),
    'it is open: loop_closures.yaml is missing beside it or in config': (KNEE, None),
    'it is open: loop_closures.yaml has no closures': (KNEE, 'dependent: [pin]'),
    # A thousandth of the size, 0.76 m, is allowed.
    'close is 0.0008 m open at joint zero': (KNEE, KNEE_LOOPS.replace('0.0145', '0.0153')),
    'joins leg, which no joint has': (KNEE, KNEE_LOOPS.replace('coupler', 'leg')),
    'the joint pin is a ball': (KNEE, f'{KNEE_LOOPS}ball_upgrades: [pin]'),
    'the joint second has <mimic>': (FOUR_BAR, FOUR_BAR_LOOPS.replace('second', 'sixth')),
    'the joint pin is floating, not revolute': (
        KNEE.replace('"pin" type="revolute"', '"pin" type="floating"'),
        KNEE_LOOPS,
    ),
    'the joint pin has no axis': (
        KNEE.replace('0.090631"/><axis xyz="0 -1 0"', '0.090631"/><axis xyz="0 0 0"'),
        KNEE_LOOPS,
    ),
    'is not three numbers up to 1e+06': (KNEE, KNEE_LOOPS.replace('0.0145', '.nan')),
    'None is not three numbers': (
        FOUR_BAR,
        FOUR_BAR_LOOPS.replace('[0.2, 0.1, 0.0]', 'null, parent_xyz: [0.2, 0.1, 0.0]'),
    ),
    "['0', 'x', '1'] is not three": (KNEE.replace('xyz="0 -1 0"', 'xyz="0 x 1"'), KNEE_LOOPS),
    'it is xacro': (f'<a xmlns="http://www.ros.org/wiki/xacro"/>{KNEE}', KNEE_LOOPS),
    'the link shin has two parents': (
        KNEE + joint('again', 'crank shin', '0 0 0'),
        KNEE_LOOPS,
    ),
    'it has 2 roots instead of one: thigh, sky': (
        KNEE + joint('rain', 'sky drop', '0 0 0'),
        KNEE_LOOPS,
    ),
    'it has 0 joints': ('', KNEE_LOOPS),
    'a part of it is missing, or is no number': (KNEE.replace('<child', '<kid'), KNEE_LOOPS),
    'not YAML': (KNEE, 'pin_loops: ]'),
    'a part of it is missing': (KNEE, '- pin'),
    'turns freely, since no loop closes over it': (
        KNEE.replace('"fixed"', '"revolute"') + joint('toe', 'foot toes', '0.1 0 0', 'fixed'),
        KNEE_LOOPS,
    ),
}


@pytest.mark.parametrize('says', REFUSED)
def test_a_urdf_of_no_linkage_is_refused_in_one_line(
    says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([written(tmp_path, *REFUSED[says])]) == 2
    out, err = capsys.readouterr()
    assert out == ''
    assert err.count('\n') == 1
    assert says in err


def test_only_a_urdf_asks_for_its_loops(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = written(tmp_path, KNEE, '')
    (tmp_path / 'loop_closures.yaml').write_bytes(b'\xff')
    for form, says in (
        ('urdf', 'a part of it is missing'),
        ('linkage2', 'no <linkage2>'),
    ):
        assert main([path, '--form', form]) == 2
        assert says in capsys.readouterr().err
