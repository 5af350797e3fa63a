"""`solver_node` under hostile inputs: it goes on, and answers the next good one."""

from contextlib import suppress
import math
from random import Random
from typing import Any

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PointStamped
from klann_ros.kinematics import KlannLeg
import pytest
from rclpy._rclpy_pybind11 import RCLError
from rclpy.serialization import serialize_message
from ros_domain import Domain
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

NUMBERS = [math.nan, math.inf, -math.inf, 1e308, -1e308, 5e-324, 1e6, -1e6, 1.0000001e6, 0.0, -0.0]
WORDS = ['', 'crank', 'Crank', 'crank' * 200, 'kurbel', '曲柄', 'alpha']


def number(random: Random) -> float:
    """Return a number that may be anything."""
    large = random.gauss(0.0, 1.0) * 10 ** random.uniform(-300, 300)
    small, valid = random.uniform(-10.0, 10.0), random.uniform(-1e6, 1e6)
    return random.choice([random.choice(NUMBERS), small, valid, large])


def hostile(random: Random) -> tuple[str, Any]:
    """Return a topic, and a message whose parts need not belong together, or damaged bytes."""
    if random.random() < 0.25:
        return 'crank_angle', Float64(data=number(random))
    names = [random.choice(WORDS) for _ in range(random.choice([0, 1, 1, 1, 2, 30]))]
    count = random.choice([len(names)] * 3 + [0, 1, 31])
    message = JointState(
        name=names,
        position=[number(random) for _ in range(count)],
        velocity=[number(random) for _ in range(random.choice([0, count, 3]))],
        effort=[number(random) for _ in range(random.choice([0, count]))],
    )
    message.header.stamp = Time(
        sec=random.randrange(-(2**31), 2**31), nanosec=random.randrange(2**32)
    )
    message.header.frame_id = random.choice(WORDS)
    if random.random() < 0.3:
        return 'crank_state', message
    data = bytearray(serialize_message(message))
    for _ in range(random.randrange(1, 20)):
        data[random.randrange(len(data))] = random.randrange(256)
    topic, longest = random.choice([('crank_angle', 20), ('crank_state', len(data))])
    return topic, bytes(data[: random.randrange(longest + 1)])


def test_it_answers_the_next_good_input_exactly(ros: Domain) -> None:
    feet = ros.probe.listen(PointStamped, 'point_h')
    solver = ros.start('solver_node')
    cranks = {
        'crank_angle': ros.probe.publisher(Float64, 'crank_angle'),
        'crank_state': ros.probe.publisher(JointState, 'crank_state'),
    }
    ros.probe.await_publishers('point_h')
    random = Random(1)  # noqa: S311 - no secret
    for count in range(5000):
        topic, message = hostile(random)
        # Some bytes are refused by the middleware already.
        with suppress(RCLError):
            cranks[topic].publish(message)
        if count % 100 == 0:
            ros.probe.spin(0.01)
    ros.probe.spin(1.0)
    assert solver.popen.poll() is None
    feet.clear()
    expected = pytest.approx(KlannLeg().closed_form(1.0).h, abs=1e-12)

    def is_answered() -> bool:
        # An input is best effort, and answers to what came before may still be on their way.
        cranks['crank_angle'].publish(Float64(data=1.0))
        ros.probe.spin(0.2)
        return bool(feet and (feet[-1].point.x, feet[-1].point.y) == expected)

    ros.probe.until(is_answered)
    assert solver.stop() == 0
    assert 'Traceback' not in solver.errors
