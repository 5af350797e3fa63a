"""`crank_node`: the n-th angle is a function of n / rate alone."""

from itertools import pairwise
from signal import SIGCONT, SIGSTOP

from klann_ros.nodes.crank.motion import CrankMotion
import pytest
from ros_domain import Domain
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

MODES: dict[str, dict[str, float]] = {
    'constant': {'speed': -6.0, 'start': 0.5},
    'sine': {'amplitude': 0.8, 'frequency': 2.0},
    'sweep': {'amplitude': -1.5, 'start': 3.0, 'speed': 4.0},
    'step': {'amplitude': 2.0, 'frequency': 5.0},
}


def test_every_mode_publishes_its_angles_and_ends(ros: Domain) -> None:
    angles = {mode: ros.probe.listen(Float64, f'/{mode}/crank_angle') for mode in MODES}
    cranks = {}
    one_turn = {'rate': 200.0, 'revolutions': 1, 'min_subscribers': 1}
    for mode, sizes in MODES.items():
        namespace = ('--ros-args', '-r', f'__ns:=/{mode}')
        cranks[mode] = ros.start('crank_node', *namespace, mode=mode, **one_turn, **sizes)
    for mode, sizes in MODES.items():
        motion = CrankMotion(mode=mode, **sizes)  # type: ignore[arg-type]
        count = round(motion.period * 200.0) + 1
        ros.probe.until(lambda: len(angles[mode]) >= count)  # noqa: B023 - called at once
        assert cranks[mode].wait() == 0
        ros.probe.spin(0.2)
        expected = [motion.at(n / 200.0)[0] for n in range(count)]
        assert [angle.data for angle in angles[mode]] == expected, mode


def test_a_state_has_stamp_name_and_rate_also_after_a_stop(ros: Domain) -> None:
    states = ros.probe.listen(JointState, 'crank_state')
    crank = ros.start(
        'crank_node',
        output='crank_state',
        crank_joint='axle',
        mode='sine',
        rate=100.0,
        revolutions=0.5,
        min_subscribers=1,
    )
    motion = CrankMotion(mode='sine')
    ros.probe.until(lambda: len(states) >= 10)
    crank.popen.send_signal(SIGSTOP)
    ros.probe.spin(0.8)
    crank.popen.send_signal(SIGCONT)
    ros.probe.until(lambda: len(states) >= 101)
    assert crank.wait() == 0
    stamps = [s.header.stamp.sec * 10**9 + s.header.stamp.nanosec for s in states]
    for n, state in enumerate(states):
        assert list(state.name) == ['axle']
        assert (state.position[0], state.velocity[0]) == motion.at(n / 100.0)
    # It goes on where it was stopped, without a burst.
    *steps, pause = sorted(late - early for early, late in pairwise(stamps))
    assert steps == pytest.approx([10**7] * 99, abs=2)
    assert pause > 5 * 10**8


def test_it_waits_for_its_subscribers(ros: Domain) -> None:
    crank = ros.start('crank_node', revolutions=1, rate=10.0, min_subscribers=1)
    ros.probe.until(lambda: 'crank_node' in ros.probe.node.get_node_names())
    ros.probe.spin(0.6)
    assert crank.popen.poll() is None
    angles = ros.probe.listen(Float64, 'crank_angle')
    ros.probe.until(lambda: len(angles) >= 11)
    assert angles[0].data == 0.0
    assert crank.wait() == 0
