"""A solver_node, a crank that the test turns, and the answers."""

from collections.abc import Sequence
from functools import partial
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PointStamped, TwistStamped
import pytest
from ros_domain import Domain, Probe
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64


class Conversation:
    """
    A solver_node in this process or its own, its legs by name, and all of its answers.

    In this process `arguments` are those for ROS.
    """

    def __init__(
        self,
        ros: Domain,
        topic: str = 'crank_angle',
        *arguments: str,
        legs: Sequence[str] = ('',),
        as_process: bool = False,
        **parameters: Any,
    ) -> None:
        self.probe: Probe = ros.probe
        prefixes = {leg: f'{leg}/' if leg else '' for leg in legs}
        self.poses = self.probe.listen(JointState, 'joint_states')
        self.feet_of, self.velocities_of = (
            {leg: self.probe.listen(kind, f'{prefix}{name}') for leg, prefix in prefixes.items()}
            for kind, name in ((PointStamped, 'point_h'), (TwistStamped, 'velocity_h'))
        )
        self.feet, self.velocities = self.feet_of[legs[0]], self.velocities_of[legs[0]]
        self.reports = self.probe.listen(DiagnosticArray, '/diagnostics')
        names = {'legs': f'[{", ".join(legs)}]'} if any(legs) else {}
        given = {'diagnostics_period': 0.3, **names, **parameters}
        start = partial(ros.start, 'solver_node') if as_process else ros.solve
        start(*arguments, **given)
        kind = Float64 if topic == 'crank_angle' else JointState
        self.crank = self.probe.publisher(kind, topic)
        for output in ('joint_states', '/diagnostics'):
            self.probe.await_publishers(output)
        for prefix in prefixes.values():
            self.probe.await_publishers(f'{prefix}point_h')
            self.probe.await_publishers(f'{prefix}velocity_h')

    def turn(self, *alphas: float) -> None:
        for alpha in alphas:
            self.crank.publish(Float64(data=alpha))

    def state(self, **fields: Any) -> None:
        stamp = fields.pop('stamp', Time())
        message = JointState(**fields)
        message.header.stamp = stamp
        self.crank.publish(message)

    def answers(self, count: int) -> list[JointState]:
        """Wait for a number of poses of all legs, and see that there are no more."""
        received = [self.poses, *self.feet_of.values()]
        self.probe.until(lambda: all(len(messages) >= count for messages in received))
        self.probe.spin(0.2)
        assert [len(messages) for messages in received] == [count] * len(received)
        return self.poses

    def assert_feet(self, expected: dict[str, Any], number: int = 0) -> None:
        """Compare the feet of an answer with places, by the names of the legs."""
        assert expected.keys() == self.feet_of.keys()
        for leg, feet in self.feet_of.items():
            foot = feet[number]
            place = (foot.point.x, foot.point.y, foot.point.z)
            assert place == pytest.approx((*expected[leg], 0.0), abs=1e-12), leg
            assert foot.header.frame_id == (f'{leg}/leg_plane' if leg else 'leg_plane')
            assert foot.header.stamp == self.poses[number].header.stamp

    def status(self, level: bytes) -> DiagnosticStatus:
        """Wait for a status of a level that comes after now."""
        self.reports.clear()

        def found() -> list[DiagnosticStatus]:
            return [s for report in self.reports for s in report.status if s.level == level]

        self.probe.until(found)
        return found()[0]

    def counts(self) -> dict[str, str]:
        """Return the values of the next report."""
        self.reports.clear()
        # A report may be on its way that is older than the last answer.
        self.probe.until(lambda: len(self.reports) >= 2)
        return {value.key: value.value for value in self.reports[1].status[0].values}
