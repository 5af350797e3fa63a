"""The shipped walkers walk: enough feet are on the ground, and all of them push forward."""

from pathlib import Path

from klann_ros.kinematics import foot_path, KlannGeometry, KlannLeg
import numpy as np
import pytest
import yaml

ROOT = Path(__file__).resolve().parents[2]
CRANK = np.linspace(0.0, 2 * np.pi, 1440, endpoint=False)
MASSES = ('bar_density', 'foot_mass', 'body_mass', 'body_size', 'body_centre')
PATH = foot_path(KlannLeg(KlannGeometry.sem104()))


def legs(number: int) -> dict[str, dict]:
    content = yaml.safe_load((ROOT / 'config' / f'walker{number}.yaml').read_text())
    parameters = content['/**']['ros__parameters']
    assert len(parameters['legs']) == number
    assert set(parameters) == {'legs', *parameters['legs'], *MASSES}
    return {name: parameters[name] for name in parameters['legs']}


def on_ground(leg: dict) -> np.ndarray:
    """Return whether the foot is on the ground, for each angle of the crank."""
    stance = PATH.stance()
    alphas = leg['direction'] * CRANK + leg['phase']
    return (alphas - stance.start) % (2 * np.pi) <= stance.end - stance.start


@pytest.mark.parametrize(
    ('number', 'shares'), [(4, {1: 0.092, 2: 0.908}), (6, {1: 0.046, 2: 0.046, 3: 0.908})]
)
def test_feet_on_the_ground_by_fraction_of_a_turn(number: int, shares: dict[int, float]) -> None:
    feet = sum(on_ground(leg).astype(int) for leg in legs(number).values())
    found = {count: np.mean(feet == count) for count in np.unique(feet)}
    assert found == pytest.approx(shares, abs=0.003)


@pytest.mark.parametrize('number', [4, 6])
def test_every_foot_pushes_the_body_forward(number: int) -> None:
    for leg in legs(number).values():
        turned = round(np.cos(leg['mount_rpy'][2]))
        # Of the foot on the ground, for a crank that turns counter-clockwise.
        assert PATH.stance().direction * leg['direction'] * turned == -1


@pytest.mark.parametrize('number', [4, 6])
def test_left_and_right_are_half_a_turn_apart(number: int) -> None:
    walker = legs(number)
    for name in walker:
        if name.endswith('_left'):
            left, right = walker[name], walker[name.replace('_left', '_right')]
            assert abs(left['phase'] - right['phase']) == np.pi
            assert left['direction'] == right['direction']
            assert left['mount_rpy'] == right['mount_rpy']
            assert left['mount_xyz'] == (np.array(right['mount_xyz']) * [1, -1, 1]).tolist()


def test_tripods_of_the_six_legged_walker_stand_around_its_middle() -> None:
    walker = legs(6)
    for tripod in (
        ('front_left', 'middle_right', 'rear_left'),
        ('front_right', 'middle_left', 'rear_right'),
    ):
        down = np.all([on_ground(walker[name]) for name in tripod], axis=0)
        assert np.mean(down) == pytest.approx(0.412, abs=0.003)
        a, b, c = (feet(walker[name])[down] for name in tripod)
        sides = [np.sign(cross(p, q)) for p, q in ((a, b), (b, c), (c, a))]
        assert np.all(np.abs(np.sum(sides, axis=0)) == 3)


def cross(p: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Return on which side of the lines from p to q the origin is."""
    return p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]


def feet(leg: dict) -> np.ndarray:
    """Return where the foot is in base_link, x and y, for each angle of the crank."""
    solver = KlannLeg(KlannGeometry.sem104())
    x = [solver.solve(leg['direction'] * crank + leg['phase']).h[0] for crank in CRANK.tolist()]
    turned = round(np.cos(leg['mount_rpy'][2]))
    return np.array([leg['mount_xyz'][:2]]) + turned * np.array([x, np.zeros_like(x)]).T
