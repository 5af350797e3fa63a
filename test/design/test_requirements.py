"""What requirements may say, and the line by which they are refused."""

from collections.abc import Mapping
from math import pi, radians
from pathlib import Path
from typing import Any

from klann_ros.design.requirements import (
    requirements_from,
    requirements_from_file,
    RequirementsError,
)
from klann_ros.design.target import PATH_POINTS, PIXEL, Target, target_from
from klann_ros.sanitize.units import UnitWarning
import numpy as np
import pytest

LEG, MM = {'linkage': 'klann'}, {'units': {'length': 'mm'}}
EXAMPLES = sorted((Path(__file__).parents[2] / 'examples' / 'requirements').glob('*.yaml'))


@pytest.mark.parametrize(
    ('content', 'message'),
    [
        ({}, 'linkage is missing, or grow'),
        ({'linkage': 'klan'}, 'did you mean klann?'),
        ({**LEG, 'figurs': {}}, 'did you mean figures?'),
        ({**LEG, 'figures': {'strid': 'maximize'}}, 'did you mean stride?'),
        ({**LEG, 'figures': {'stride': 'maximise'}}, 'did you mean maximize?'),
        ({**LEG, 'figures': {'stride': {'at_least': 'far'}}}, 'must be a number [m]'),
        ({**LEG, 'figures': {'duty_factor': {'at_least': 1.2}}}, 'out of its bounds, 0 to 1'),
        ({**LEG, 'figures': {'transmission_angle': {'at_least': 40}}}, 'units: {angle: deg}'),
        ({**LEG, 'figures': {'lift': {'at_least': 2, 'at_most': 1}}}, 'at_least is above at_most'),
        ({**LEG, 'figures': {'speed': 'maximize'}}, 'needs walker'),
        ({**LEG, 'parts': {'thickness': 3}}, 'parts: material is missing'),
        ({**LEG, 'parts': {'material': 'pla'}}, 'did you mean PLA?'),
        ({**LEG, 'parts': {'material': 'PLA', 'infill': 0}}, 'parts.infill: 0 must be > 0'),
        ({**LEG, 'figures': {'torque_peak': 'minimize'}}, 'needs load'),
        ({**LEG, 'vary': {'A-C': [1, 2]}}, 'A-C is no dimension'),
        ({**LEG, 'vary': {'A-B': [0.2, 0.1]}}, 'the range [0.2, 0.1] m is empty'),
        ({**LEG, 'vary': {'A-B': [0, 0.1]}}, 'a length must be > 0'),
        ({**LEG, 'vary': 0}, 'leaves nothing to vary'),
        ({**LEG, 'vary': -5}, 'must be >= 0'),
        ({**LEG, 'tie': {'A-B': 'A-X'}}, 'A-X is no dimension'),
        ({**LEG, 'path': {}}, 'either points or file'),
        ({**LEG, 'path': {'points': [[0, 0], [0, 0], [0, 0]]}}, 'all points are one'),
        ({'linkage': 'sem104', 'path': {'points': [[0, 0], [1, 0], [0, 1]]}}, 'such as klann'),
        ({**LEG, 'walker': {'legs': 5}}, 'must be one of 4, 6, 8'),
        ({**LEG, 'count': 0}, 'must be >= 1'),
        ({**LEG, 'forbidden': [{'polygon': [[0, 0], [1, 1], [1, 0], [0, 1]]}]}, 'crosses itself'),
        ({'grow': {'dyads': 1}, **MM}, 'grow.crank is missing: the range of its length [mm]'),
        ({'grow': {'dyads': 3}}, '3 must be <= 2'),
        ({'grow': {'dyad': 1}}, 'did you mean dyads?'),
        ({'grow': {'dyads': 1, 'crank': [30, 20]}, **MM}, 'grow.crank: the range [30, 20] is'),
        ({'grow': {'dyads': 1, 'crank': [0, 20]}}, '0 must be > 0'),
    ],
)
def test_a_wish_is_refused_in_one_line(content: Mapping[str, Any], message: str) -> None:
    with pytest.raises(RequirementsError) as error:
        requirements_from(content)
    assert message in str(error.value)
    assert '\n' not in str(error.value)


@pytest.mark.parametrize('file', EXAMPLES, ids=lambda file: file.stem)
def test_the_examples_are_accepted(file: Path) -> None:
    assert requirements_from_file(file).spaces


def test_numbers_are_in_the_units_of_the_wish() -> None:
    requirements = requirements_from(
        {
            **LEG,
            'units': {'length': 'mm', 'angle': 'deg'},
            'vary': {'A-B': [100, 140], 'bend of C-G': [-5, 5]},
            'figures': {'lift': {'at_least': 60}, 'transmission_angle': {'near': 40}},
            'speed': 90,
        }
    )
    assert requirements.speed == pytest.approx(0.5 * pi)
    (space,) = requirements.spaces
    (limit,) = requirements.limits
    (aim,) = requirements.aims
    assert space.low.tolist() == pytest.approx([0.1, radians(-5)])
    assert limit.value == pytest.approx(0.06)
    assert aim.value == pytest.approx(radians(40))


def test_tied_dimensions_move_together_and_a_scale_moves_all_lengths() -> None:
    requirements = requirements_from(
        {
            **LEG,
            'vary': {'D-C': [0.1, 0.2]},
            'tie': {'E-F': 'D-C', 'E.x': '-D-C'},
            'scale': [0.5, 2],
        }
    )
    (space,) = requirements.spaces
    variants = space.variants(np.array([[0.5, 1.0], [0.0, 0.0]]))
    numbers = dict(zip(space.linkage.dimensions, variants.numbers, strict=True))
    assert numbers['D-C'].tolist() == pytest.approx([0.3, 0.05])
    assert numbers['E-F'].tolist() == numbers['D-C'].tolist()
    assert numbers['E.x'].tolist() == (-numbers['D-C']).tolist()
    assert numbers['A-B'].tolist() == pytest.approx([0.24, 0.06])
    assert numbers['bend of C-G'].tolist() == [space.linkage.dimensions['bend of C-G']] * 2


@pytest.mark.parametrize('size', [1e-3, 1.0])
def test_a_limit_of_zero_is_held_relative_to_size_and_load(size: float) -> None:
    content = {**LEG, 'scale': [0.9999 * size, 1.0001 * size], 'load': 0.01, 'vary': 0}
    figures = {'lift': {'at_least': 0}, 'torque_peak': {'at_least': 0}}
    limits = requirements_from({**content, 'figures': figures}).limits
    longest = size * 0.7
    for limit, scale in zip(limits, (longest, 0.01 * longest), strict=True):
        assert 0.3 * scale < limit.scale < 3.0 * scale


def test_a_damaged_file_is_named(tmp_path: Path) -> None:
    file = tmp_path / 'requirements.yaml'
    file.write_text('linkage: [klann')
    with pytest.raises(
        RequirementsError, match=r'requirements\.yaml holds no requirements: line 1'
    ):
        requirements_from_file(file)
    with pytest.raises(RequirementsError, match='cannot be read: No such file'):
        requirements_from_file(tmp_path / 'none.yaml')


def test_a_path_is_read_from_points_csv_and_svg(tmp_path: Path) -> None:
    corners = [[0, 0], [3, 0], [3, 1], [0, 1]]
    (tmp_path / 'a.csv').write_text('x,y\n0,0\n3,0\n3,1\n0,1\n')
    (tmp_path / 'b.csv').write_text('x;y\n0,0;0,0\n3,0;0,0\n3,0;1,0\n0,0;1,0\n')
    svg = '<svg><g><path class="p" d="M0 0h3v-1 L 0,-1 z"/></g></svg>'
    (tmp_path / 'c.svg').write_text(svg)
    expected = [complex(*corner) for corner in corners]
    for content in ({'points': corners}, {'file': 'a.csv'}, {'file': 'b.csv'}):
        points = target_from(content, 1e-3, tmp_path).points
        assert points.tolist() == pytest.approx([1e-3 * z for z in expected])
    drawn = target_from({'file': 'c.svg'}, 1e-3, tmp_path).points
    assert drawn.tolist() == pytest.approx([PIXEL * z for z in expected])


def test_a_curve_of_an_svg_is_a_bezier_curve(tmp_path: Path) -> None:
    (tmp_path / 'a.svg').write_text('<svg><path d="M0 0 C0 -4 4 -4 4 0 S 8 4 8 0"/></svg>')
    points = target_from({'file': 'a.svg'}, 1.0, tmp_path).points / PIXEL
    assert complex(points[12]) == pytest.approx(2 + 3j)
    assert points[-1] == pytest.approx(8)
    assert points.imag.min() == pytest.approx(-3)


def test_an_arc_of_an_svg_is_a_circle(tmp_path: Path) -> None:
    circle = '<svg><path d="M1 0 A1 1 0 0 1 -1 0 A1 1 0 0 1 1 0 z M5 5 L6 6"/></svg>'
    (tmp_path / 'a.svg').write_text(circle)
    points = target_from({'file': 'a.svg'}, 1.0, tmp_path).points / PIXEL
    assert abs(points) == pytest.approx(1.0, abs=3e-4)
    assert len(points) > 60


@pytest.mark.parametrize(
    ('name', 'content', 'message'),
    [
        ('a.csv', '1,2\nx,y\n', 'line 2'),
        ('a.csv', '1,2\n', '1 points'),
        ('a.svg', '<svg/>', 'no path'),
        ('a.svg', '<path d="M0 0 C1 1 2"/>', 'Not enough coordinates'),
        ('a.svg', '<path d="10 10"/>', 'the path of the SVG'),
        ('a.svg', '<path d="M0 0 \x1b[31m"/>', 'the path of the SVG'),
        ('a.svg', '<path d="M0 0 L1e999 0 1 1"/>', 'not finite'),
        # In time proportional to its length.
        ('a.svg', '<path ' * 100_000, 'has no path'),
        ('a.svg', '<path d="M0 0 M1 1 M2 2"/>', '1 points'),
    ],
)
def test_a_damaged_path_is_refused(name: str, content: str, message: str, tmp_path: Path) -> None:
    (tmp_path / name).write_text(content)
    with pytest.raises(RequirementsError, match=message):
        requirements_from({**LEG, 'path': {'file': name}}, tmp_path)


@pytest.mark.parametrize('is_timed', [False, True])
@pytest.mark.parametrize('freedom', ['can_move', 'can_turn', 'can_scale'])
def test_a_path_is_fitted_by_the_allowed_transformations(freedom: str, *, is_timed: bool) -> None:
    t = 2.0 * pi * np.arange(400) / 400
    z = np.exp(1j * t) + 0.3 * np.exp(-2j * t) + 0.1 * np.exp(3j * t)
    all_off = {'can_move': False, 'can_turn': False, 'can_scale': False}
    target = Target(z, **{**all_off, freedom: True}, is_timed=is_timed)
    change = {'can_move': (1.0, 0.7j), 'can_turn': (np.exp(0.8j), 0.0), 'can_scale': (1.7, 0.0)}
    factor, shift = change[freedom]
    # From another start, backwards.
    path = np.roll((z - shift) / factor, 200)[::-1]
    feet = np.stack([path.real, path.imag], axis=-1)[None]
    fit = target.fit(feet)
    assert fit.error[0] < 1e-3
    assert complex(fit.factor[0]) == pytest.approx(complex(factor), abs=1e-2)
    fixed = Target(z, **all_off, is_timed=is_timed)
    assert fixed.fit(feet).error[0] > 0.1
    assert PATH_POINTS == 128


@pytest.mark.parametrize(
    ('content', 'name'),
    [
        ({**LEG, 'figures': {'stride': {'at_least': 400}}}, 'figures.stride.at_least = 400'),
        ({**LEG, 'vary': {'A-B': [100, 150]}}, 'vary.A-B = 150'),
        ({**LEG, 'path': {'points': [[0, 0], [300, 0], [0, 400]]}}, 'the size of path = 500'),
        ({'grow': {'dyads': 1, 'crank': [30, 60]}}, 'grow.crank = 60'),
    ],
)
def test_warns_of_lengths_without_units_that_look_like_millimetres(
    content: Mapping[str, Any], name: str, recwarn: pytest.WarningsRecorder
) -> None:
    requirements_from({**content, 'units': {'length': 'mm', 'angle': 'deg'}})
    assert not recwarn.list
    requirements_from({**content, 'units': {'angle': 'deg'}})
    (warning,) = recwarn.list
    assert warning.category is UnitWarning
    assert str(warning.message).startswith(f'{name} is read as')
    assert str(warning.message).endswith('in mm, write units: {length: mm, angle: deg}')
