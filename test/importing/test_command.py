"""The command import_linkage: its inputs, its output, and its refusals."""

from collections.abc import Iterator
from contextlib import contextmanager
from math import atan2, cos, pi, sin
import os
from pathlib import Path
from typing import Any

from klann_ros.importing.command import main
from klann_ros.kinematics import linkage_from_file, LinkageLeg
import pytest
from yaml_tables import read_table

REFUSED = read_table(Path(__file__).with_name('refused.yaml'))
# A four-bar with a point on its coupler, its ground in the second column of links.
FOUR_BAR = """\
A,0,0,ground crank
B,10,30,crank coupler
C,70,60,coupler rocker
D,90,0,rocker ground
E,30,70,coupler
"""
# Templates of PMKS+, component/MODALS/templates in PMKS-Web/PMKSWeb (MIT), its lengths in cm.
PMKS_PLUS = {
    'slider_crank': '0P.TY.K,0.101.MA,A,0mA,0c,0.GB,B,0Yt,bK,0.GC,C,il,H-,0.LD,D,il,H-,0..YRAB,AB,'
    'Fe,Fe,0fW,IN,c5cae9,A,B,,.YRBC,BC,Fe,Fe,4y,Rf,303e9f,B,C,,.YPCD,CD,Fe,0,0,0,,C,D,,...JAe',
    'watt_ii': '0P.TY.K,0.101.MA,A,0Vf,0Vd,0.GB,B,0mZ,08A,0.GC,C,06Y,LC,0.GD,D,1MR,J2,0.KE,E,rw,'
    '0j2,0.GF,F,2ic,ID,0.KG,G,2lk,0Zt,0..YRAB,AB,Fe,Fe,0e6,0Ju,c5cae9,A,B,,.YRBC,BC,Fe,Fe,0RY,6X,'
    '303e9f,B,C,,.YRCDE,CDE,Fe,Fe,ic,01d,0d125a,C,D,E,,.YRDF,DF,Fe,Fe,21X,Id,B2DFDB,D,F,,.YRFG,FG,'
    'Fe,Fe,2kA,08r,26A69A,F,G,,...JBm',
}

# Mechanisms of docs/fixture-urls.md in PMKS-Web/Planar-Mechanism-Kinematic-Simulator (MIT), whose
# records are longer; here a link is marked A or 1 instead of Y, and the name of one has blanks.
SCOTCH_YOKE = (
    '2v.Ay,1E8.A,0.1011.6A,A,0,0,0.1B,B,Fe,0,0,CD,C,D.DC,C,Fe,0VG,0.0D,D,Fe,S8,0..ARAB,AB,Fe,Fe,'
    '7q,0,c5cae9,A,B,,.YRCD,Yoke of CD,Fe,Fe,Fe,01a,303e9f,C,D,,...N_N*0RRtxB'
)
PUNCH_PRESS = (
    '2v.Ay,1E8.A,0.1011.6A,A,0,0,0.0B,B,0,Im,0.5C,C,0,0r8,OZ,,,,,1Tm..YRAB,Crank,VG,o,0,9O,c5cae9,'
    'A,B,,.1RBC,Connecting rod,ku,6G,0,0HC,303e9f,B,C,,..2F1,BC,F1,0,0r8,0,0bW,1Xg0..N_p*3gSQPQ'
)
# The pivot of the crank [mm].
PMKS_PLUS_A = {'slider_crank': [-30.82, -0.38], 'watt_ii': [-20.25, -20.23]}


@contextmanager
def standard_input(file: Path | None) -> Iterator[None]:
    """Make a file the standard input of this process; None closes it."""
    saved = os.dup(0)
    try:
        if file is None:
            os.close(0)
        else:
            with file.open('rb') as opened:
                os.dup2(opened.fileno(), 0)
        yield
    finally:
        os.dup2(saved, 0)
        os.close(saved)


@pytest.mark.parametrize('entry', REFUSED, ids=lambda entry: entry['says'][:40])
def test_a_text_without_a_linkage_is_refused_in_one_line(
    entry: dict[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / 'file'
    file.write_text(entry['text'])
    assert main([str(file)]) == 2
    out, err = capsys.readouterr()
    assert out == ''
    assert err.count('\n') == 1
    assert entry['says'] in err


def test_a_file_becomes_a_linkage_file(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / 'bar.csv').write_text(FOUR_BAR)
    output = tmp_path / 'bar.yaml'
    assert main([str(tmp_path / 'bar.csv'), '-o', str(output), '--unit', 'in']) == 0
    linkage = linkage_from_file(output)
    assert linkage.name == 'bar'
    assert linkage.pivots[1] == pytest.approx(90 * 25.4e-3)
    assert linkage.structure.foot == 'E'
    out, err = capsys.readouterr()
    assert out == f'written: {output}\n'
    assert 'crank crank, foot E' in err


@pytest.mark.parametrize('encoding', ['cp1252', 'utf-16'])
def test_a_file_of_windows_is_read(
    encoding: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / 'bar.csv'
    file.write_text(FOUR_BAR.replace('rocker', 'balanço'), encoding=encoding)
    for source in (str(file), '-'):
        with standard_input(file):
            assert main([source]) == 0
        assert '  balanco: [C, D]\n' in capsys.readouterr().out


def test_a_text_and_the_standard_input_are_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([FOUR_BAR]) == 0
    text = capsys.readouterr().out
    file = tmp_path / 'file'
    file.write_text(FOUR_BAR)
    with standard_input(file):
        assert main(['-']) == 0
    assert capsys.readouterr().out.replace('standard input', 'text') == text


def test_a_standard_input_that_is_closed_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with standard_input(None):
        assert main(['-']) == 2
    assert 'import_linkage: - cannot be read: Bad file' in capsys.readouterr().err


def test_a_table_of_a_spreadsheet_is_read(capsys: pytest.CaptureFixture[str]) -> None:
    rows = [row.split(',', 3) for row in FOUR_BAR.replace('10,', '10.5,').splitlines()]
    table = '\ufeffsep=;\r\n# a note\r\n"Name";X; Y ;Links;More\r\n;;;;\r\n'
    for name, x, y, links in rows:
        table += f'{name};{x.replace(".", ",")};{y};"{links.replace(" ", ", ")}";-\r\n'
    assert main([f'{table}; ;;\t;\r\n']) == 0
    assert capsys.readouterr().out.splitlines()[4:6] == ['  A: [0.0, 0.0]', '  B: [10.5, 30.0]']


def test_one_of_several_motors_is_chosen(capsys: pytest.CaptureFixture[str]) -> None:
    rows = [f'{row},{"x" * (row[0] in "AD")}' for row in FOUR_BAR.splitlines()]
    text = '\n'.join(['name,x,y,links,driven', *rows])
    assert main([text]) == 2
    assert 'motors' in capsys.readouterr().err
    assert main([text, '--crank', 'rocker']) == 0
    assert 'crank rocker, foot E' in capsys.readouterr().err


@pytest.mark.parametrize('no', ['', '0', 'no', 'False', '-'])
def test_a_cell_that_says_no_marks_no_joint(no: str, capsys: pytest.CaptureFixture[str]) -> None:
    marks = {'B': f'{no},yes', 'D': f'1,{no}'}
    rows = [f'{row},{marks.get(row[0], f"{no},{no}")}' for row in FOUR_BAR.splitlines()]
    assert main(['\n'.join(['name,x,y,links,driven,traced', *rows])]) == 0
    assert 'crank rocker, foot B;' in capsys.readouterr().err


def test_crank_and_foot_are_chosen_by_their_names_in_the_text(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = FOUR_BAR.replace('rocker', 'Hebel-2').replace('C,', 'ö 1,')
    output = tmp_path / 'bar.yaml'
    assert main([text, '-o', str(output), '--crank', 'Hebel']) == 2
    assert 'there are crank, Hebel_2; did you mean Hebel_2?' in capsys.readouterr().err
    assert main([text, '--foot', 'EE']) == 2
    says = 'the foot EE is no joint: there are A, B, o_1, D, E'
    assert says in capsys.readouterr().err
    assert main([text, '-o', str(output), '--crank', 'Hebel-2', '--foot', 'ö 1']) == 0
    structure = linkage_from_file(output).structure
    assert structure.crank.angle == 'Hebel_2'
    assert structure.foot == 'o_1'


def test_names_of_a_stranger_become_valid_names(capsys: pytest.CaptureFixture[str]) -> None:
    hostile = FOUR_BAR.replace('A,', '\x1b[2J,').replace('B,', 'joint 1,').replace('C,', '\u202e,')
    hostile = hostile.replace('D,', f'{"no" * 100},').replace('coupler', 'on').replace('E,', 'no,')
    assert main([hostile]) == 0
    out, err = capsys.readouterr()
    assert (out + err).replace('\n', '').isprintable()
    assert "  'on': [joint_1, P, 'no']" in out
    assert f'ground: [P2J, {"no" * 20}]' in out


def test_names_that_become_alike_are_numbered(capsys: pytest.CaptureFixture[str]) -> None:
    text = FOUR_BAR.replace('A,', 'P 1,').replace('B,', 'P-1,').replace('C,', 'P_1,')
    assert main([text.replace('coupler', 'bar.').replace('rocker', 'bar#')]) == 0
    out = capsys.readouterr().out
    assert '  bar: [P_2, P_3, E]\n  bar2: [P_3, D]\n' in out


def test_links_that_share_two_pins_are_one(capsys: pytest.CaptureFixture[str]) -> None:
    text = FOUR_BAR.replace('ground crank', 'ground frame1 crank').replace(
        'rocker ground', 'rocker ground frame1'
    )
    text = text.replace('C,70,60,coupler', 'C,70,60,coupler plate').replace(
        'E,30,70,coupler', 'E,30,70,coupler plate'
    )
    assert main([text]) == 0
    assert 'links:\n  crank: [A, B]\n  coupler: [B, C, E]\n  rocker: [C, D]\n' in (
        capsys.readouterr().out
    )


def test_a_url_of_pmks_plus_becomes_a_linkage_that_turns(tmp_path: Path) -> None:
    output = tmp_path / 'leg.yaml'
    for name, text in PMKS_PLUS.items():
        # A part of a welded link, which counts for nothing.
        welded = text.replace('..YRAB', '..NRXY,XY,Fe,Fe,0,0,c5cae9,A,C,,.YRAB')
        for query in (welded, welded.replace(',', '%2C')):
            assert main([f'https://app.pmksplus.com/?{query}', '-o', str(output)]) == 0
            leg = LinkageLeg(linkage_from_file(output))
            assert leg.linkage.structure.crank.angle == 'AB'
            assert len(leg.reachable_arcs()) == 1
            points = read_table(output)['points']
            assert points['A'] == pytest.approx(PMKS_PLUS_A[name])


@pytest.mark.parametrize('angle', [0.4, 2.0, 5.0])
def test_slots_of_pmks_plus_are_on_the_ground_or_on_a_link(angle: float, tmp_path: Path) -> None:
    output = tmp_path / 'linkage.yaml'
    assert main([f'https://app.pmksplus.com/?{SCOTCH_YOKE}', '-o', str(output)]) == 0
    # The yoke is welded to its slider.
    assert LinkageLeg(linkage_from_file(output)).solve(angle).h[0] == pytest.approx(
        0.01 * cos(angle)
    )
    assert main([f'?{PUNCH_PRESS}', '-o', str(output), '--foot', 'C']) == 0
    crank, rod = 12e-3, 46e-3
    ram = LinkageLeg(linkage_from_file(output)).solve(angle).h
    height = crank * sin(angle) - (rod**2 - (crank * cos(angle)) ** 2) ** 0.5
    assert ram == pytest.approx([0.0, height], abs=1e-5)


def test_links_of_one_identifier_and_attributes_without_a_space_stay_apart(
    capsys: pytest.CaptureFixture[str],
) -> None:
    text = '<linkage2><program/>'
    for number, place in enumerate(
        ('0" y="0" anchor="true', '10" y="30', '70" y="60', '90" y="0')
    ):
        anchor = ' anchor="true"' if number == 3 else ''
        text += f'<connector id="{number}"x="{place}"{anchor}/>'
    for number in range(3):
        ends = f'<connector id="{number}"/><connector id="{number + 1}"/>'
        text += f'<Link id="0" name="a & b">{ends}</Link>'
    assert main([f'{text}<Link id="9" layer="1" gear="true"/></linkage2>']) == 0
    links = 'links:\n  link0: [P0, P1]\n  link1: [P1, P2]\n  link2: [P2, P3]\n'
    assert links in capsys.readouterr().out


def test_a_joint_that_nothing_moves_is_left_out(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([FOUR_BAR.replace('30,70,coupler', '30,70,cupler')]) == 0
    out, err = capsys.readouterr()
    assert 'foot: C\n' in out
    assert 'left out, as on no link of two joints: E' in err


@pytest.mark.parametrize(('sign', 'bar'), [('1', 1 + 0j), ('-1', (21 - 20j) / 29)])
def test_an_assembly_says_how_a_pose_in_line_goes_on(
    sign: str, bar: complex, tmp_path: Path
) -> None:
    text = 'A,0,0,ground crank\nB,40,0,crank bar\nC,140,0,bar rocker\nD,100,0,rocker ground\n'
    output = tmp_path / 'bar.yaml'
    assert main([f'{text}P,40,-80,bar', '-o', str(output), '--assembly', sign]) == 0
    # The bar of a parallelogram keeps its direction; the other one's is by Pythagoras.
    foot = complex(*LinkageLeg(linkage_from_file(output)).solve(0.5 * pi).h)
    assert foot == pytest.approx(0.04j - 0.08j * bar)


def test_a_yoke_slides_on_the_ground_and_a_block_on_the_yoke(tmp_path: Path) -> None:
    text = (
        'name,x,y,links,type,angle\nA,0,0,ground crank,R,\nB,30,40,crank block,R,\n'
        'S,30,40,block yoke,P,90\nC,50,10,ground yoke,P,0\nT,50,10,yoke,RP,0\n'
    )
    output = tmp_path / 'yoke.yaml'
    assert main([text, '-o', str(output), '--foot', 'T']) == 0
    leg = LinkageLeg(linkage_from_file(output))
    start = leg.solve(atan2(40, 30)).h
    # The yoke follows the pin of the crank along x.
    assert leg.solve(0.5 * pi).h == pytest.approx((start[0] - 0.03, start[1]))


def test_a_missing_file_a_folder_and_too_much_text_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    long_file = tmp_path / 'long'
    long_file.write_text('x' * 1_000_001)
    workbook = tmp_path / 'workbook'
    workbook.write_bytes(b'PK\x03\x04\xff')
    sources: dict[Any, str] = {
        'no.csv': 'No such file',
        tmp_path: 'a folder',
        long_file: 'longer than 1000000 bytes',
        workbook: 'a workbook: save it as CSV',
    }
    for source, reason in sources.items():
        assert main([str(source)]) == 2
        assert reason in capsys.readouterr().err


def test_the_source_is_not_overwritten(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / 'bar.csv'
    file.write_text(FOUR_BAR)
    assert main([str(file), '-o', str(file)]) == 3
    assert 'only read' in capsys.readouterr().err
    assert file.read_text() == FOUR_BAR


@pytest.mark.parametrize(
    'text',
    ['[' * 900_000, 'M[' * 400_000, '#[\n' * 300_000 + 'M[', '<linkage2>' + '<a>' * 200_000],
    ids=['brackets', 'expressions', 'comments', 'elements'],
)
def test_deep_nesting_is_refused(
    text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / 'file'
    file.write_text(text)
    assert main([str(file)]) == 2
    assert len(capsys.readouterr().err) < 500
