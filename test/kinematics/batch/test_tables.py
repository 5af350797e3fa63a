"""A table is the single poses and motions of its leg, in columns, on paper and as CSV."""

import copy
import csv
from io import StringIO
import math

from change_point_linkages import change_point_file
from klann_ros.kinematics import (
    FourBar,
    KlannLeg,
    linkage_from_file,
    LinkageLeg,
    shipped_linkage,
    shipped_linkages,
    SingularPoseError,
    UnreachableError,
)
import numpy as np
import pytest

RATE = -3.0
LEG = KlannLeg()
ALPHAS = np.radians([0.0, 60.0, 120.0])


@pytest.mark.parametrize('name', [*shipped_linkages(), 'two_turns', 'coupled_parallelogram'])
def test_a_row_is_the_pose_with_its_velocity_and_acceleration(name: str) -> None:
    if name in shipped_linkages():
        linkage = shipped_linkage(name)
    else:
        linkage = linkage_from_file(change_point_file(name))
    leg = LinkageLeg(linkage)
    period = linkage.change_points.period
    alphas = np.radians(np.arange(0.0, 360.0 * period, 7.5)).reshape(period, -1)
    table = leg.table(alphas, RATE)
    points = [point for point in linkage.structure.points if point not in linkage.structure.pivots]
    moving = [linkage.structure.points.index(point) for point in points]
    closed = 0
    for index, alpha in np.ndenumerate(alphas):
        row = {column: float(numbers[index]) for column, numbers in table.columns.items()}
        try:
            pose = leg.closed_form(alpha)
            velocity = leg.velocity(pose, RATE)
        except UnreachableError:
            assert np.isnan([*row.values()][1:]).all()
            continue
        except SingularPoseError:
            assert math.isnan(row[f'{leg.joint_names[1]}_rate'])
            continue
        closed += 1
        acceleration = leg.acceleration(pose, RATE, 0.0)
        # Where a dyad is nearly in line, or interpolated, the last digits are rounding.
        is_near = linkage.interpolated(float(alpha)) is not None
        scale = 1e5 if is_near else 1.0 / min(pose.sines) ** 3
        states = ('', pose), ('_rate', velocity), ('_acceleration', acceleration)
        for suffix, state in states:
            joints = [row[f'{joint}{suffix}'] for joint in leg.joint_names[1:]]
            assert joints == pytest.approx(state.joints[1:], rel=1e-11, abs=1e-13 * scale)
            places = [[row[f'{point}.{axis}{suffix}'] for axis in 'xy'] for point in points]
            expected = state.points[moving]
            assert np.array(places) == pytest.approx(expected, rel=1e-11, abs=1e-13 * scale)
        angles = [row[f'mu_{k + 1}'] for k in range(len(linkage.blocks))]
        assert angles == pytest.approx(pose.transmission_angles, abs=1e-11 * scale)
        for joint, rate in zip(leg.joint_names[1:], velocity.joints[1:], strict=True):
            advantage = row[f'{joint}_advantage']
            assert (1.0 / advantage) * RATE == pytest.approx(rate, rel=1e-11, abs=1e-13 * scale)
    assert closed > 10
    assert len(table.columns) == 1 + 4 * len(leg.joint_names[1:]) + 6 * len(points) + len(angles)


def test_without_a_rate_it_has_positions_only() -> None:
    names = [*LEG.table(ALPHAS).columns]
    assert names[:7] == ['alpha', 'gamma', 'beta', 'delta', 'theta', 'B.x', 'B.y']
    assert not [name for name in names if 'rate' in name or 'advantage' in name]
    with pytest.raises(ValueError, match='crank_rate = nan is refused'):
        LEG.table(ALPHAS, float('nan'))


def test_a_column_has_its_name() -> None:
    table = LEG.table(ALPHAS)
    assert table.gamma is table['gamma']
    assert not table.gamma.flags.writeable
    assert copy.copy(table)['H.x'] is table['H.x']
    with pytest.raises(AttributeError, match='one of `columns`'):
        _ = table.gama


def test_where_a_rocker_turns_back_its_advantage_is_infinite() -> None:
    bar = FourBar(180, 80, 200, 150)
    table = bar.table([point.theta2 for point in bar.dead_points('rocker')], 1.0)
    assert table.theta2.shape == (2,)
    assert np.isinf(table.theta4_advantage).all()
    assert np.isinf(table.mechanical_advantage).all()
    between = bar.table(ALPHAS, 2.0)
    assert between.theta4_advantage == pytest.approx(between.mechanical_advantage, rel=1e-13)


def test_it_is_printed_in_lines_that_fit() -> None:
    lines = str(LEG.table(ALPHAS, 2.0)).splitlines()
    assert max(map(len, lines)) <= 99
    firsts = [line.split()[0] for line in lines[:5]]
    assert firsts == ['alpha', '[deg]', '0.00', '60.00', '120.00']
    assert lines[3].split()[1:5] == ['10.66', '67.33', '34.46', '45.72']
    assert ' -0.00' not in str(FourBar(180, 80, 200, 150).table([0.0, math.pi], 1.0))
    (heads, _) = FourBar(180, 80, 200, 150, unit='mm').table(0.0).csv().splitlines()
    assert heads.split(',')[5] == 'Z [mm]'


@pytest.mark.parametrize(('decimal', 'delimiter'), [('.', ','), (',', ';')])
def test_csv_is_read_back_to_the_last_digit(decimal: str, delimiter: str) -> None:
    table = LinkageLeg(shipped_linkage('chebyshev')).table(np.radians([0.0, 170.0]), 2.0)
    rows = [*csv.reader(StringIO(table.csv(decimal_comma=decimal == ',')), delimiter=delimiter)]
    units = [unit.replace('rad', 'deg') if unit == 'rad' else unit for unit in table.units]
    scales = [180.0 / math.pi if unit == 'deg' else 1e3 if 'm' in unit else 1 for unit in units]
    assert len(rows) == 3
    for n, (name, numbers) in enumerate(table.columns.items()):
        assert rows[0][n].split(' [')[0] == name
        texts = [row[n].replace(decimal, '.') for row in rows[1:]]
        read = [float(text) / scales[n] if text else math.nan for text in texts]
        assert read == pytest.approx(numbers.tolist(), rel=1e-15, nan_ok=True)
    assert '' in rows[2]
