"""A linkage is one YAML file; an error in it, and degrees for radians, are refused in a line."""

import math
from pathlib import Path

from four_bars import FOUR_BAR, refusal
from klann_ros.kinematics import (
    GeometryError,
    KlannGeometry,
    length_margins,
    linkage_from_file,
    linkage_from_text,
    linkage_poses,
    LinkageFileError,
    LinkageLeg,
    Reason,
    shipped_linkage,
    tolerance_study,
    Variants,
)
import numpy as np
import pytest
from yaml_tables import read_table

FOLDER = Path(__file__).parent
WATT = (FOLDER / 'watt.yaml').read_text(encoding='utf-8')
REFUSED = read_table(FOLDER / 'refused_files.yaml')


def test_a_linkage_is_added_by_a_file_alone(tmp_path: Path) -> None:
    file = tmp_path / 'watt.yaml'
    file.write_text(WATT, encoding='utf-8')
    leg = LinkageLeg(linkage_from_file(file))
    pose = leg.solve(0.0)
    # The middle of the link, half way between the pivots, where Watt wanted it.
    assert pose.h == pytest.approx((0.100, 0.030), abs=1e-15)
    feet = np.array([leg.solve(alpha).h for alpha in np.linspace(-0.25, 0.25, 51)])
    # It goes up and down by nearly the arm's way, and hardly to the side.
    assert np.ptp(feet[:, 1]) > 0.04
    assert np.ptp(feet[:, 0]) < 1e-4
    velocity = leg.velocity(leg.solve(0.0), 2.0)
    assert velocity.h == pytest.approx((0.0, 0.2), abs=1e-14)
    assert velocity.joints == pytest.approx((2.0, 0.0, 2.0), abs=1e-14)
    (start, end), *more_arcs = leg.reachable_arcs()
    assert not more_arcs
    assert end - start < 2 * math.pi


def edited(**changes: str) -> str:
    """Return Watt's file with texts replaced: old=new, by pairs."""
    text = WATT
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    return text


@pytest.mark.parametrize(
    ('name', 'old', 'new', 'reason'),
    [(name, *row) for name, rows in REFUSED.items() for row in rows],
)
def test_an_error_is_reported_in_one_line(name: str, old: str, new: str, reason: str) -> None:
    if name == 'four_bar':
        text = FOUR_BAR % (', angle: deg', 'start: {crank: 60, coupler: 15, rocker: 80}')
    else:
        text = (FOLDER / f'{name}.yaml').read_text(encoding='utf-8')
    assert old in text
    with pytest.raises(LinkageFileError) as caught:
        linkage_from_text(text.replace(old, new, 1), 'test.yaml')
    assert str(caught.value).startswith('test.yaml holds no linkage: ')
    assert reason in str(caught.value)
    assert '\n' not in str(caught.value)


VALUES = ['9' * 400, '9' * 5000, '[' * 5000, '{a: ' * 3000, '&a [*a]', "'" + 'x' * 100_000 + "'"]
VALUES += ['1e308', '1e-200', '1e999', '0x_', '2001-99-99']
VALUES += ['!!int abc', '!!bool abc', '!!timestamp abc', '!!map x']


@pytest.mark.parametrize('value', VALUES, ids=lambda value: value[:20])
def test_no_value_is_more_than_a_line(value: str) -> None:
    for place in ('to: A, length: 100', 'units: {length: mm, angle: deg}', 'O: [0, 0]'):
        text = edited(**{place: f'{place.rpartition(": ")[0]}: {value}'})
        with pytest.raises(LinkageFileError) as caught:
            linkage_from_text(text, 'watt.yaml')
        assert '\n' not in str(caught.value)
        assert len(str(caught.value)) < 500


def test_aliases_do_not_grow() -> None:
    bomb = 'm0: &m0 {a: 1}\n'
    for k in range(9):
        bomb += f'm{k + 1}: &m{k + 1} {{<<: [{", ".join([f"*m{k}"] * 9)}]}}\n'
    with pytest.raises(LinkageFileError, match='anchors and aliases are not taken'):
        linkage_from_text(bomb, 'bomb.yaml')


def test_a_number_needs_no_dot() -> None:
    plain = linkage_from_text(WATT, 'plain')
    powers = linkage_from_text(edited(**{'to: A, length: 100': 'to: A, length: 1e2'}), 'powers')
    assert powers == plain


@pytest.mark.parametrize('text', ['', '7', '[1, 2]', '- a\n- b', 'a: b', '? [1, 2]\n: 3'])
def test_non_linkage_files_are_refused(text: str) -> None:
    with pytest.raises(LinkageFileError, match=r'^x\.yaml holds no linkage: [^\n]+$'):
        linkage_from_text(text, 'x.yaml')


def test_a_file_that_cannot_be_read_is_refused(tmp_path: Path) -> None:
    with pytest.raises(LinkageFileError, match=r'none\.yaml cannot be read: No such file'):
        linkage_from_file(tmp_path / 'none.yaml')
    (tmp_path / 'binary.yaml').write_bytes(b'\xff\xfe\x00')
    with pytest.raises(LinkageFileError, match=r'binary\.yaml cannot be read'):
        linkage_from_file(tmp_path / 'binary.yaml')


def test_a_folder_hides_no_linkage(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'jansen').mkdir()
    assert linkage_from_file('jansen') == shipped_linkage('jansen')


def test_units_are_those_of_the_file() -> None:
    metres = WATT.replace('{length: mm, angle: deg}', '{}')
    metres = metres.replace('link: 90, other_arm: 180', f'link: {math.pi / 2}, other_arm: 3.14159')
    in_m = linkage_from_text(metres, 'm').points(0.0, [math.pi / 2, math.pi])
    in_mm = linkage_from_text(WATT, 'mm').points(0.0, [math.pi / 2, math.pi])
    np.testing.assert_allclose(in_m, 1000 * in_mm, rtol=1e-15)


LEG = KlannGeometry.sem104().linkage


@pytest.mark.parametrize('name', ['angle_bcg', 'angle_fgh'])
@pytest.mark.parametrize('degrees', [10.0, -40.0, 7, 1e300])
def test_a_bend_beyond_a_turn_is_refused(name: str, degrees: float) -> None:
    text = f'{name} = {degrees:g} rad is refused: a bend must be within'
    for make in (lambda: KlannGeometry(**{name: degrees}), lambda: LEG.varied({name: degrees})):
        with pytest.raises(GeometryError) as caught:
            make()
        assert str(caught.value).startswith(text)
        radians = f'{math.radians(degrees):.6g}'
        assert f'if {degrees:g} deg are meant, give {radians}' in str(caught.value)
    variants = Variants(LEG, {name: [0.1, degrees]})
    assert 'deg are meant' in variants.reason(1)
    assert linkage_poses(variants, 1.0).reason.tolist() == [0, Reason.REFUSED]


def test_a_bend_of_a_whole_turn_is_none() -> None:
    bent_back = KlannGeometry(angle_bcg=math.radians(10.0) - 2 * math.pi)
    expected = pytest.approx(LinkageLeg(LEG).solve(1.0).h, abs=1e-14)
    assert LinkageLeg(bent_back.linkage).solve(1.0).h == expected
    KlannGeometry(angle_fgh=math.radians(360.0))


def test_margins_of_a_bend_are_searched_for_a_whole_turn() -> None:
    bent_back = KlannGeometry(angle_bcg=math.radians(10.0) - 2 * math.pi).linkage
    expected = pytest.approx(length_margins(LEG)['angle_bcg'].changes, abs=1e-9)
    assert length_margins(bent_back)['angle_bcg'].changes == expected


def test_a_tolerance_of_degrees_is_refused() -> None:
    with pytest.raises(ValueError, match=r'tolerance of angle_bcg = 10 .*2 pi rad \(degrees\?\)'):
        tolerance_study(LEG, {'angle_bcg': 10}, samples=2, crank_angles=4)


def start_of(angles: tuple[float, ...]) -> str:
    crank, coupler, rocker = angles
    return f'start: {{crank: {crank}, coupler: {coupler}, rocker: {rocker}}}'


# Newton-Raphson would go from three of these to either assembly; the last is near no pose.
@pytest.mark.parametrize('angles', [(180, 60, 104), (60, 15, 80), (60, -74, 235), (180, 260, 6)])
def test_a_start_that_can_only_be_degrees_is_refused(angles: tuple[float, ...]) -> None:
    text = refusal(start_of(angles), '')
    assert 'is in radians near no pose in which it closes' in text
    assert 'for degrees write units: {angle: deg}' in text
    assert 'there are the assemblies [1] (coupler' in text
    assert '; [-1] (coupler' in text


def test_small_degrees_are_refused_where_an_assembly_is_near() -> None:
    flat = FOUR_BAR.replace('[180, 0]', '[345, 0]').replace('length: 80', 'length: 10')
    flat = flat.replace('from: O4, to: B', 'from: B, to: O4')
    start = 'start: {crank: 3, coupler: 5, rocker: -6}'
    with pytest.raises(LinkageFileError, match=r'write units: \{angle: deg\}'):
        linkage_from_text(flat % ('', start), 'flat.yaml')
    pose = LinkageLeg(linkage_from_text(flat % (', angle: deg', start), 'flat.yaml')).solve(0.05)
    assert np.abs(pose.x).max() < 0.4


# One is more than a turn, but near a pose; the last is a drawing 25 degrees off.
RADIANS = [(1.05, 0.3, 1.4), (1.0472, -1.2, -2.2), (7.3304, 0.4, 7.5), (1.05, 0.8, 1.7)]


@pytest.mark.parametrize('angles', RADIANS)
def test_a_start_in_radians_is_taken(angles: tuple[float, ...]) -> None:
    linkage = linkage_from_text(FOUR_BAR % ('', start_of(angles)), 'four_bar.yaml')
    assert linkage.assembly in {(1,), (-1,)}


def test_a_bend_in_degrees_is_refused_in_a_file() -> None:
    bent = FOUR_BAR.replace('length: 200}', 'length: 200}, {from: B, to: P, length: 9, bend: 30}')
    start = 'start: {crank: 60, coupler: 15, rocker: 80}'
    with pytest.raises(LinkageFileError) as caught:
        linkage_from_text(bent % ('', start), 'bent.yaml')
    reason = 'bodies.coupler.bars[1].bend: 30 must be within +-2 pi rad; for degrees'
    assert reason in str(caught.value)
    assert linkage_from_text(bent % (', angle: deg', start), 'bent.yaml')
    beyond_a_turn = bent.replace('bend: 30', 'bend: 400')
    with pytest.raises(LinkageFileError, match=r'bend: 400 must be within \+-360 deg$'):
        linkage_from_text(beyond_a_turn % (', angle: deg', start), 'bent.yaml')
