"""The joints of JointStates that a review keeps, where the run defines no leg."""

from klann_ros.review.load.columns import JointSelection
from klann_ros.review.load.legs import LegDefinitions
import pytest

LEG = ('alpha', 'gamma', 'beta', 'delta', 'theta')


@pytest.fixture
def definitions() -> LegDefinitions:
    return LegDefinitions([], None)


@pytest.mark.parametrize(
    ('topic', 'joints', 'selection'),
    [
        ('/joint_states', (*LEG, 'arm'), JointSelection(LEG, ('alpha',), is_input=False)),
        # Cranks of any name, which ros2_control or a driver publishes.
        ('/joint_states', ('left', 'right'), JointSelection(('left', 'right'), (), is_input=True)),
        (
            '/crank_state',
            ('crank', 'arm'),
            JointSelection(('crank', 'arm'), ('crank',), is_input=True),
        ),
        ('/crank_command', ('arm',), JointSelection(('arm',), (), is_input=False)),
        # Another robot's, but for a crank.
        ('/motors', ('crank', 'arm'), JointSelection(('crank',), ('crank',), is_input=True)),
        ('/motors', ('arm',), JointSelection((), (), is_input=True)),
    ],
)
def test_the_joints_of_legs_and_cranks_are_kept(
    definitions: LegDefinitions, topic: str, joints: tuple[str, ...], selection: JointSelection
) -> None:
    assert definitions.selection(topic, joints) == selection


@pytest.mark.parametrize(
    ('topic', 'joints', 'count', 'is_lacking'),
    [
        ('/crank_state', ('crank',), 0, True),
        ('/crank_state', (), 0, False),
        # A command may be of velocities alone.
        ('/crank_command', ('crank',), 0, False),
        ('/crank_command', ('crank',), 2, True),
        ('/joint_states', ('arm', 'left/gamma'), 0, True),
        ('/joint_states', ('arm', 'left.gamma'), 0, False),
    ],
)
def test_legs_and_cranks_need_positions(
    definitions: LegDefinitions, topic: str, joints: tuple[str, ...], count: int, is_lacking: bool
) -> None:
    assert definitions.lacks_positions(topic, joints, count) == is_lacking
