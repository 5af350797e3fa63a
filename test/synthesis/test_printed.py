"""Positions and function generators have the numbers that textbooks print."""

import math
from pathlib import Path
from typing import Any

from klann_ros.kinematics import FourBar
from klann_ros.sanitize.yaml_text import parse_file
from klann_ros.synthesis import freudenstein, function_generators
import numpy as np
import pytest

PRINTED: dict[str, Any] = parse_file(Path(__file__).with_name('printed.yaml'))


@pytest.mark.parametrize('example', PRINTED['positions'], ids=lambda each: each['source'][:30])
def test_positions_are_the_printed_ones(example: dict[str, Any]) -> None:
    ground = example['ground']
    for theta_2, theta_4, theta_3 in example['rows']:
        modes = (FourBar(*example['lengths'], mode) for mode in (1, -1))
        poses = [mode.closed_form(math.radians(theta_2 - ground)) for mode in modes]
        away = [
            max(
                abs(math.remainder(math.degrees(found) + ground - printed, 360.0))
                for found, printed in ((pose.theta3, theta_3), (pose.theta4, theta_4))
            )
            for pose in poses
        ]
        assert min(away) <= example['tolerance']


@pytest.mark.parametrize('example', PRINTED['rocker-positions'], ids=lambda each: each['source'])
def test_three_rocker_positions_give_the_printed_lengths(example: dict[str, Any]) -> None:
    theta_2, theta_4 = np.radians(example['theta_2']), np.radians(example['theta_4'])
    printed = np.array(example['cosines_of_theta_4'] + example['cosines_of_theta_2'])
    assert np.abs(np.cos([*theta_4, *theta_2]) - printed).max() < 6e-4
    assert np.abs(np.cos(theta_2 - theta_4) - example['cosines_of_differences']).max() < 3e-4
    (found,) = function_generators(
        theta_2, theta_4, input_start=0.0, output_start=0.0, ground=example['ground']
    )
    assert found.is_sound
    assert found.geometry.lengths[1:] == pytest.approx(
        example['lengths'], rel=example['tolerance']
    )
    # Freudenstein's equation holds to rounding.
    k_1, k_2, k_3 = freudenstein(theta_2, theta_4)
    left = k_1 * np.cos(theta_4) - k_2 * np.cos(theta_2) + k_3
    assert np.allclose(left, np.cos(theta_2 - theta_4), rtol=0, atol=1e-12)
