"""How many feet of the shipped walkers are on the ground."""

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
    measured = {count: np.mean(feet == count) for count in np.unique(feet)}
    assert measured == pytest.approx(shares, abs=0.003)
