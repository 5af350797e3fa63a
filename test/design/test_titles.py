"""The titles of legs: what distinguishes each, never the same twice."""

from types import SimpleNamespace
from typing import Any

from klann_ros.design import requirements_from
from klann_ros.design.titles import aims_text, leg_titles
import pytest

TWO_AIMS = {'linkage': 'klann', 'figures': {'stride': 'maximize', 'torque_peak': 'minimize'}}
TWO_AIMS |= {'load': 1.0}


def titles(content: dict[str, Any], **figures: list[float]) -> list[str]:
    columns = zip(*figures.values(), strict=True)
    legs: Any = [SimpleNamespace(reached=dict(zip(figures, row, strict=True))) for row in columns]
    return leg_titles(requirements_from(content), legs)


def test_a_leg_has_the_title_of_the_figure_in_which_it_is_best() -> None:
    named = titles(
        TWO_AIMS,
        stride=[0.4, 0.39, 0.38, 0.2, 0.1],
        torque_peak=[5.0, 4.9, 2.0, 1.5, 1.0],
        margin=[0.1, 0.3, 0.2, 0.15, 0.12],
    )
    assert named == [
        'longest stride', 'highest margin', 'balanced', '2nd lowest torque peak',
        'lowest torque peak',
    ]  # fmt: skip


@pytest.mark.parametrize(
    ('strides', 'named'),
    [
        ([0.5], ['']),
        # Alike to the digits shown.
        ([0.5, 0.5 + 1e-9], ['', '']),
        ([0.5, 0.4, 0.3], ['longest stride', '2nd longest stride', '3rd longest stride']),
    ],
)
def test_legs_that_nothing_distinguishes_have_no_title(
    strides: list[float], named: list[str]
) -> None:
    assert titles({'linkage': 'klann', 'figures': {'stride': 'maximize'}}, stride=strides) == named


def test_no_title_is_there_twice() -> None:
    strides = [0.5 - 0.001 * n for n in range(120)]
    torques = [4.0 - 0.01 * n for n in range(120)]
    named = titles(TWO_AIMS, stride=strides, torque_peak=torques)
    assert len(set(named)) == 120
    assert {'11th longest stride', '22nd longest stride'} < {*named}


def test_a_single_aim_is_told_in_words() -> None:
    near = {'linkage': 'klann', 'units': {'length': 'mm'}, 'figures': {'stride': {'near': 300}}}
    assert aims_text(requirements_from(near)) == 'One aim: stride near 300 mm'
    assert aims_text(requirements_from(TWO_AIMS)).startswith('Aims: stride maximized, torque peak')
