"""The proof of a leg: what it must refuse, for each reason, and what must pass."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from klann_ros.datasheet import data_sheet, motor_from_file
from klann_ros.design import proof, requirements_from
from klann_ros.design.leg_file import leg_text, parameter_text, walker_parameters
from klann_ros.design.proof import check_file, FittedCandidate, FoundLeg, ProofError, prove
from klann_ros.design.requirements import Limit
from klann_ros.export import weighed_leg
from klann_ros.gait import walk_figures
from klann_ros.kinematics import (
    foot_path,
    length_margins,
    Linkage,
    linkage_poses,
    LinkageLeg,
    shipped_linkage,
)
from klann_ros.robot import robot_from_text, robot_of, RobotLeg
import numpy as np
import pytest

FOUR_BAR = shipped_linkage('four_bar')
# Without losses: its torque falls from 10 N m to 0 at 10 rad/s.
MOTOR = 'stall_torque: 1\nno_load_speed: 100\ngear_ratio: 10\nefficiency: 1\n'
# Any figure bulk computes is a lie: the proof must not look at it.
LIES = {'stride': 1e3, 'lift': 1e3, 'transmission_angle': 1.5, 'path_error': 0.0, 'margin': 9.0}


def proven(linkage: Linkage, name: str = 'four_bar', **content: Any) -> FoundLeg:
    requirements = requirements_from({'linkage': name, **content})
    return prove(requirements, FittedCandidate(requirements.spaces[0], linkage, LIES))


@pytest.fixture(scope='module')
def four_bar_leg() -> FoundLeg:
    return proven(FOUR_BAR)


def refusal(linkage: Linkage, name: str = 'four_bar', **content: Any) -> ProofError:
    with pytest.raises(ProofError) as error:
        proven(linkage, name, **content)
    return error.value


def parallelogram(deviation: float) -> Linkage:
    lengths = {'O2-A': 0.04, 'A-B': 0.1, 'O4-B': 0.04 * (1.0 + deviation), 'O4.x': 0.1}
    return FOUR_BAR.varied(lengths)


def path_of(linkage: Linkage, turn: complex = 1.0) -> dict[str, Any]:
    h = linkage_poses(linkage, np.linspace(0.0, 2.0 * np.pi, 1000, endpoint=False)).h
    z = turn * (h @ (1.0, 1j))
    return {'points': np.stack([z.real, z.imag], axis=1).tolist()}


def test_a_leg_that_turns_passes_with_the_figures_of_its_file() -> None:
    leg = proven(FOUR_BAR)
    assert leg.expected == LIES
    # A crank-rocker: its closed form.
    lengths = np.hypot(0.08, 0.0), 0.2, 0.15, 0.18
    crank, coupler, rocker, ground = lengths
    cosines = []
    for d in (ground - crank, ground + crank):
        cosines.append((coupler**2 + rocker**2 - d**2) / (2.0 * coupler * rocker))
    angles = np.arccos(cosines)
    worst = np.minimum(angles, np.pi - angles).min()
    assert leg.reached['transmission_angle'] == pytest.approx(worst, rel=1e-9)
    assert leg.reached['turning_fraction'] == 1.0
    assert leg.non_turning_fraction == 0.0
    assert leg.tolerance == 1e-3
    assert leg.walker is None
    assert leg.linkage == FOUR_BAR
    for name, margin in length_margins(FOUR_BAR).items():
        assert leg.margins[name] == pytest.approx((margin.least, margin.greatest))


@pytest.mark.parametrize('name', ['sem104', 'klann'])
def test_a_leg_is_proven_by_the_text_of_its_file(name: str, tmp_path: Path) -> None:
    # More digits than a file has.
    linkage = requirements_from({'linkage': name}).spaces[0].linkage
    drawn = linkage.varied({k: v * (1.0 + 1e-12) for k, v in linkage.dimensions.items()})
    leg = proven(drawn, name)
    assert leg.linkage != drawn
    file = tmp_path / 'leg.yaml'
    file.write_text(leg_text(leg.leg))
    check_file(file, leg)


@pytest.mark.parametrize('rocker', [0.09, 0.0999])
def test_a_leg_that_jams_is_refused(rocker: float) -> None:
    # 80 + 200 > 180 + rocker: no Grashof chain.
    error = refusal(FOUR_BAR.varied({'O4-B': rocker}))
    assert str(error) == 'the crank does not turn fully'
    assert error.limit is None
    assert np.isnan(error.value)
    proven(FOUR_BAR.varied({'O4-B': 0.1001}))


@pytest.mark.parametrize('deviation', [1e-9, 5e-7])
def test_links_in_line_are_refused(deviation: float) -> None:
    assert str(refusal(parallelogram(deviation))) == 'links are in line'


def test_a_parallelogram_by_construction_passes_and_none_by_rounding() -> None:
    leg = proven(parallelogram(0.0))
    assert leg.reached['stride'] == pytest.approx(0.08, rel=1e-6)
    assert leg.reached['transmission_angle'] <= 1e-9
    # Written with 9 digits it would be another leg.
    assert str(refusal(parallelogram(1e-12))) == 'its file has another leg'


def test_links_nearly_in_line_pass_with_the_angle() -> None:
    # At d = 60 mm: d^2 - (100 - 40 (1 + eps))^2 = 100 x 40 mu^2.
    angle = proven(parallelogram(1e-5)).reached['transmission_angle']
    assert angle == pytest.approx(np.sqrt(1.2e-5), rel=1e-4)


def test_a_linkage_that_cannot_be_assembled_is_refused() -> None:
    refusal(FOUR_BAR.varied({'O4-B': 1e-3}))


@pytest.mark.parametrize('sense', ['at_least', 'at_most'])
@pytest.mark.parametrize('figure', ['stride', 'transmission_angle', 'bar_ratio', 'margin'])
def test_a_limit_holds_to_the_last_digit(four_bar_leg: FoundLeg, figure: str, sense: str) -> None:
    reached = four_bar_leg.reached[figure]
    sign = 1.0 if sense == 'at_least' else -1.0
    units = {'length': 'm', 'angle': 'rad'}
    beyond = {figure: {sense: reached * (1.0 + sign * 1e-6)}}
    error = refusal(FOUR_BAR, figures=beyond, units=units)
    assert str(error) == f'{figure} does not hold'
    assert error.limit == Limit(figure, sense, beyond[figure][sense])
    assert error.value == pytest.approx(reached, rel=1e-12)
    proven(FOUR_BAR, figures={figure: {sense: reached}}, units=units)


@pytest.mark.parametrize('sense', ['at_least', 'at_most'])
@pytest.mark.parametrize('figures', [{}, {'lift': np.nan}])
def test_a_limit_without_a_value_does_not_hold(
    figures: Mapping[str, float], sense: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    reached = {'transmission_angle': 1.0, **figures}
    monkeypatch.setattr(proof, 'sheet_figures', lambda *_: dict(reached))
    error = refusal(FOUR_BAR, figures={'lift': {sense: 0.0 if sense == 'at_least' else 9.0}})
    assert str(error) == 'lift does not hold'
    assert np.isnan(error.value)
    # An aim without a value is no reason, and is not reported.
    assert 'lift' not in proven(FOUR_BAR, figures={'lift': 'maximize'}).reached


def test_a_transmission_angle_without_a_value_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(proof, 'sheet_figures', lambda *_: {'transmission_angle': np.nan})
    assert str(refusal(FOUR_BAR)) == 'links are in line'


def test_limits_of_every_figure_are_checked() -> None:
    figures = {'lift': {'at_most': 1}, 'stride': {'at_least': 1}, 'margin': {'at_least': 0}}
    error = refusal(FOUR_BAR, figures=figures, units={'length': 'm'})
    assert error.limit == Limit('stride', 'at_least', 1.0)


def other_legs() -> Mapping[str, Linkage]:
    return {
        'mirrored': FOUR_BAR.mirrored(),
        'another assembly': FOUR_BAR.in_assembly((-1,)),
        'longer by 2e-6': FOUR_BAR.varied({'A-B': 0.2 * (1.0 + 2e-6)}),
        'moved': FOUR_BAR.varied({'O2.y': 1e-3, 'O4.y': 1e-3}),
    }


@pytest.mark.parametrize('name', other_legs())
def test_another_leg_in_the_file_is_refused(
    four_bar_leg: FoundLeg, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    text = leg_text(four_bar_leg.leg)
    candidate = other_legs()[name]
    monkeypatch.setattr(proof, 'leg_text', lambda _: text)
    assert str(refusal(candidate)) == 'its file has another leg'


@pytest.mark.parametrize('text', ['', 'name: [', 'speed: 3', '/**: {ros__parameters: {}}'])
def test_a_file_without_a_leg_is_refused(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(proof, 'leg_text', lambda _: text)
    refusal(FOUR_BAR)


@pytest.mark.parametrize('name', [*other_legs(), 'none', 'cut off'])
def test_another_leg_on_disk_is_refused(four_bar_leg: FoundLeg, name: str, tmp_path: Path) -> None:
    leg = four_bar_leg
    file = tmp_path / 'leg.yaml'
    if name in other_legs():
        file.write_text(leg_text(proven(other_legs()[name]).leg))
    elif name == 'cut off':
        file.write_text(leg_text(leg.leg)[:-40])
    with pytest.raises(ProofError, match=r'leg\.yaml'):
        check_file(file, leg)
    file.write_text(leg_text(leg.leg))
    check_file(file, leg)


@pytest.mark.parametrize('turn', [1j, 0.99])
def test_the_leg_is_not_moved_onto_its_path_again(turn: complex) -> None:
    # The search moves, turns and scales a leg; the file's leg stays where it is.
    path = path_of(FOUR_BAR, turn)
    size = abs(turn) * np.hypot(*np.ptp(np.array(path_of(FOUR_BAR)['points']), axis=0))
    error = proven(FOUR_BAR, path=path).reached['path_error']
    assert 1e-3 * size < error < 3.0 * size
    same = proven(FOUR_BAR, path=path_of(FOUR_BAR)).reached['path_error']
    assert same < 1e-4 * size


def test_a_limit_of_the_path_is_that_of_the_file() -> None:
    error = refusal(
        FOUR_BAR, path=path_of(FOUR_BAR, 1.1), figures={'path_error': {'at_most': 1e-3}}
    )
    assert error.value > 1e-3
    # LIES has 0.
    assert str(error) == 'path_error does not hold'


def test_a_tolerance_is_in_metres_and_the_default_relative() -> None:
    # 80 + 200 = 180 + 100: the rocker is 0.1 mm longer than a crank that jams.
    narrow = FOUR_BAR.varied({'O4-B': 0.1003})
    by_default = proven(narrow)
    # The lengths within 0.08, 0.2 and 0.1 mm.
    assert by_default.tolerance == 1e-3
    assert 0.0 < by_default.non_turning_fraction < 0.1
    for tolerance, low, high in ((0.09, 0.0, 0.0), (0.5, 0.1, 0.45), (5.0, 0.4, 0.6)):
        leg = proven(narrow, units={'length': 'mm'}, tolerance=tolerance)
        assert leg.tolerance == pytest.approx(1e-3 * tolerance)
        assert low <= leg.non_turning_fraction <= high
        assert leg.reached['turning_fraction'] == 1.0 - leg.non_turning_fraction


def test_a_tolerance_as_large_as_a_bar_is_refused() -> None:
    refusal(FOUR_BAR, units={'length': 'mm'}, tolerance=90)


@pytest.mark.slow
def test_the_load_the_speed_and_the_motor_are_those_of_the_requirements(tmp_path: Path) -> None:
    (tmp_path / 'motor.yaml').write_text(MOTOR)
    kind: dict[str, Any] = {'motor': str(tmp_path / 'motor.yaml')}
    klann = shipped_linkage('klann')
    first = proven(klann, 'klann', load=1, speed=1, **kind).reached
    twice = proven(klann, 'klann', load=2, speed=1, **kind).reached
    assert twice['torque_peak'] == pytest.approx(2.0 * first['torque_peak'])
    assert twice['torque_range'] == pytest.approx(2.0 * first['torque_range'])
    assert twice['motor_margin'] == pytest.approx(first['motor_margin'] / 2.0)
    faster = proven(klann, 'klann', load=1, speed=5, **kind).reached
    assert faster['torque_peak'] == pytest.approx(first['torque_peak'])
    # Its torque falls with the speed.
    assert faster['motor_margin'] == pytest.approx(first['motor_margin'] * 5.0 / 9.0)


@pytest.mark.slow
def test_the_motor_of_a_walker_turns_several_legs(tmp_path: Path) -> None:
    motor = tmp_path / 'motor.yaml'
    motor.write_text(MOTOR)
    klann = shipped_linkage('klann')
    options: dict[str, Any] = {'load': 9, 'speed': 2, 'motor': str(motor)}
    leg = proven(klann, 'klann', walker={'legs': 8}, **options)
    assert leg.walker is not None
    walker = robot_from_text(parameter_text(leg.walker), 'the walker')
    sheet = data_sheet(walker, speed=2.0, load=9.0, motor=motor_from_file(str(motor)))
    margins = [crank.motor.margin for crank in sheet.cranks if crank.motor is not None]
    assert leg.reached['motor_margin'] == pytest.approx(min(margins), rel=1e-3)
    assert leg.reached['motor_margin'] < proven(klann, 'klann', **options).reached['motor_margin']


def test_a_leg_and_its_walker_weigh_their_parts() -> None:
    klann = shipped_linkage('klann').scaled(0.25)
    parts = {'material': 'PLA', 'infill': 0.3, 'thickness': 4, 'pins': 'steel'}
    options: dict[str, Any] = {'units': {'length': 'mm'}, 'parts': parts}
    leg = proven(klann, 'klann', walker={'legs': 8}, **options)
    assert leg.walker is not None
    assert {'speed', 'static_margin', 'height_variation'} <= leg.reached.keys()
    assert '\\n' not in parameter_text(leg.walker)
    walker = robot_from_text(parameter_text(leg.walker), 'the walker')
    expected = weighed_leg(leg.leg, {**parts, 'thickness': 4e-3}).masses
    assert expected is not None
    assert expected.source == 'parts of PLA, 4 mm, infill 30 %, pins of steel, by export'
    assert [walker_leg.masses for walker_leg in walker.legs] == [expected] * 8
    assert 'density' not in leg.leg.description


def test_parts_that_cannot_be_made_refuse_a_leg() -> None:
    parts = {'material': 'PLA', 'width': 3e-3}
    error = refusal(shipped_linkage('klann'), 'klann', parts=parts)
    assert 'a bar wider than its hole' in str(error)


@pytest.mark.slow
def test_a_walker_is_proven_from_its_file() -> None:
    klann = shipped_linkage('klann')
    options = {'walker': {'legs': 8}, 'speed': 2}
    leg = proven(klann, 'klann', **options)
    assert leg.walker is not None
    slow = proven(klann, 'klann', **{**options, 'speed': 1}).reached
    assert leg.reached['speed'] == pytest.approx(2.0 * slow['speed'])
    assert leg.reached['static_margin'] == slow['static_margin']
    speed = leg.reached['speed']
    figures = {'speed': {'at_least': 1.000001 * speed}}
    assert refusal(klann, 'klann', **options, figures=figures).value == pytest.approx(speed)
    proven(klann, 'klann', **options, figures={'speed': {'at_least': speed}})


@pytest.mark.slow
@pytest.mark.parametrize('name', ['jansen', 'ghassaei'])
def test_the_legs_of_a_group_stand_together(name: str) -> None:
    stance = foot_path(LinkageLeg(shipped_linkage(name))).stance()
    (leg,) = robot_of(name).legs
    for count in (6, 8):
        text = parameter_text(walker_parameters(leg, {'legs': count}))
        walk = walk_figures(robot_from_text(text, 'the walker'))
        assert walk.speed == pytest.approx(abs(stance.speed(1.0)), rel=0.15)
        # They hardly drag one another.
        assert walk.slid < 0.11 * stance.ground_covered


@pytest.mark.slow
def test_a_leg_without_a_stance_is_no_walker(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise proof.NoWalkerError('no walker')

    monkeypatch.setattr(proof, 'walk_figures', fail)
    error = refusal(shipped_linkage('klann'), 'klann', walker={'legs': 8})
    assert str(error) == 'no walker'


def test_coupled_loops_are_proven_on_their_branch(monkeypatch: pytest.MonkeyPatch) -> None:
    # Margins of coupled loops take 15 s.
    sheet = proof.data_sheet
    monkeypatch.setattr(
        proof, 'data_sheet', lambda robot, **kind: sheet(robot, **{**kind, 'margins': False})
    )
    monkeypatch.setattr(proof, '_non_turning_fraction', lambda *_: 0.0)
    linkage = shipped_linkage('stephenson')
    leg = proven(linkage, 'stephenson')
    assert leg.reached['stride'] == pytest.approx(0.0734358, rel=1e-5)


@pytest.mark.slow
def test_the_mass_of_a_leg_is_no_load_of_the_crank() -> None:
    requirements = requirements_from({'linkage': 'sem104', 'load': 1})
    (space,) = requirements.spaces
    leg = prove(requirements, FittedCandidate(space, space.linkage, {}))
    assert isinstance(leg.leg, RobotLeg)
    massless = proven(shipped_linkage('klann'), 'klann', load=1).reached
    assert leg.reached['torque_peak'] == pytest.approx(massless['torque_peak'], rel=1e-3)
