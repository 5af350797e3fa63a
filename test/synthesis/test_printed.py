"""Positions, velocities and function generators have the numbers that textbooks print."""

import math
from pathlib import Path
from typing import Any

from klann_ros.kinematics import FourBar, linkage_from_text, LinkageLeg
from klann_ros.sanitize.yaml_text import parse_file
from klann_ros.synthesis import freudenstein, function_generators
import numpy as np
import pytest

PRINTED: dict[str, Any] = parse_file(Path(__file__).with_name('printed.yaml'))


@pytest.mark.parametrize(
    'example', PRINTED['positions'], ids=lambda four_bar: four_bar['source'][:30]
)
def test_positions_are_the_printed_ones(example: dict[str, Any]) -> None:
    ground = example['ground']
    for theta_2, theta_4, theta_3 in example['rows']:
        printed = np.radians([theta_3 - ground, theta_4 - ground])
        errors = []
        for assembly in (1, -1):
            four_bar = FourBar(*example['lengths'], assembly)
            angles = np.array(four_bar.closed_form(math.radians(theta_2 - ground)).x)
            errors.append(np.abs(np.angle(np.exp(1j * (angles - printed)), deg=True)).max())
        assert min(errors) <= example['tolerance']


@pytest.mark.parametrize(
    'example', PRINTED['rocker-positions'], ids=lambda four_bar: four_bar['source']
)
def test_three_rocker_positions_give_the_printed_lengths(example: dict[str, Any]) -> None:
    theta_2, theta_4 = np.radians(example['theta_2']), np.radians(example['theta_4'])
    printed = np.array(example['cosines_of_theta_4'] + example['cosines_of_theta_2'])
    assert np.abs(np.cos([*theta_4, *theta_2]) - printed).max() < 6e-4
    assert np.abs(np.cos(theta_2 - theta_4) - example['cosines_of_differences']).max() < 3e-4
    (linkage,) = function_generators(
        theta_2, theta_4, input_start=0.0, output_start=0.0, ground=example['ground']
    )
    assert linkage.is_sound
    expected = pytest.approx(example['lengths'], rel=example['tolerance'])
    assert linkage.geometry.lengths[1:] == expected
    # Freudenstein's equation holds to rounding.
    k_1, k_2, k_3 = freudenstein(theta_2, theta_4)
    left = k_1 * np.cos(theta_4) - k_2 * np.cos(theta_2) + k_3
    assert np.allclose(left, np.cos(theta_2 - theta_4), rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    'example', PRINTED['velocities'], ids=lambda four_bar: four_bar['source'][:30]
)
def test_velocities_are_the_printed_ones(example: dict[str, Any]) -> None:
    x, y = example['pivot']
    ground = math.atan2(y, x)
    bars = [FourBar(math.hypot(x, y), *example['bars'], assembly) for assembly in (1, -1)]
    poses = [(bar, bar.closed_form(example['theta_2'] - ground)) for bar in bars]
    four_bar, pose = min(
        poses, key=lambda bar_and_pose: abs(bar_and_pose[1].theta3 + ground - example['theta_3'])
    )
    moving = four_bar.velocity(pose, example['omega_2'])
    motion = [pose.theta3 + ground, pose.theta4 + ground, moving.theta3, moving.theta4]
    printed = [example[name] for name in ('theta_3', 'theta_4', 'omega_3', 'omega_4')]
    assert motion == pytest.approx(printed, rel=0, abs=6e-5)


ARM = """
name: Quick return with a horizontal ground
pivots: {A: [0, 0], C: [-0.3, 0]}
crank: crank
foot: F
bodies:
  crank: {bars: [{from: A, to: B, length: 0.15}]}
  arm: {bars: [{from: C, to: F, length: 0.5}]}
  block: {slides: {along: arm, from: C, to: B}}
start: {crank: 1.0471975511965976, arm: 0.3335, block: 0.397}
"""


@pytest.mark.parametrize(
    'example', PRINTED['quick-returns'], ids=lambda linkage: linkage['source'][-40:]
)
def test_quick_returns_move_as_printed(example: dict[str, Any]) -> None:
    leg = LinkageLeg(linkage_from_text(ARM, 'arm'))
    rate = example['speed'] * 2.0 * math.pi / 60.0
    pose = leg.closed_form(math.radians(example['theta_2']))
    velocity = leg.velocity(pose, rate)
    acceleration = leg.acceleration(pose, rate, 0.0)
    computed = {
        'arm': math.degrees(pose.x[0]),
        'F': pose.h,
        'omega': velocity.joints[1],
        # The program gives the velocity of the arm against the block.
        'slide': -velocity.joints[2],
        'epsilon': acceleration.joints[1],
        'v_F': velocity.h,
        'a_F': acceleration.h,
    }
    for name, printed in example['printed'].items():
        assert np.allclose(computed[name], printed, rtol=0, atol=example['tolerance'][name]), name
