"""Two motors of a walker on a probe, and how it walks."""

from pathlib import Path

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import TwistStamped
from nav_msgs.msg import Odometry
from ros_domain import Domain
from sensor_msgs.msg import JointState

CONFIG = Path(__file__).resolve().parents[2] / 'config'
TWO_MOTORS = str(CONFIG / 'walker6_two_motors.yaml')
JOINTS = ['left_crank', 'right_crank']


class Motors:
    """Two motors on the probe: they turn as commanded, times their factors."""

    def __init__(self, ros: Domain, prefix: str = '') -> None:
        self.probe = ros.probe
        self.commands = self.probe.listen(JointState, f'{prefix}crank_command')
        self.odom = self.probe.listen(Odometry, f'{prefix}odom')
        self.reports = self.probe.listen(DiagnosticArray, '/diagnostics')
        self.state = self.probe.publisher(JointState, f'{prefix}crank_state')
        self.cmd_vel = self.probe.publisher(TwistStamped, f'{prefix}cmd_vel')
        self.factors = [1.0, 0.9]
        self.positions = [0.0, 0.0]
        # All angles that were published.
        self.measured: set[tuple[float, ...]] = set()
        self.silent: set[int] = set()
        # Empty: they measure none [N m].
        self.efforts: list[float] = []
        self.twist: tuple[float, float] | None = None
        self.ticks = 0
        self.probe.node.create_timer(0.01, self._tick)

    def _tick(self) -> None:
        self.ticks += 1
        commanded = list(self.commands[-1].velocity) if self.commands else [0.0, 0.0]
        rates = [f * v for f, v in zip(self.factors, commanded, strict=True)]
        self.positions = [p + 0.01 * r for p, r in zip(self.positions, rates, strict=True)]
        self.measured.add(tuple(self.positions))
        reporting = [k for k in range(2) if k not in self.silent]
        message = JointState(
            name=[JOINTS[k] for k in reporting],
            position=[self.positions[k] for k in reporting],
            velocity=[rates[k] for k in reporting],
            effort=[self.efforts[k] for k in reporting] if self.efforts else [],
        )
        # They turn by ticks, which a busy machine delays.
        message.header.stamp.sec, ticks = divmod(self.ticks, 100)
        message.header.stamp.nanosec = ticks * 10_000_000
        self.state.publish(message)
        if self.twist is not None:
            self.send(*self.twist)

    def send(self, linear: float, angular: float) -> None:
        message = TwistStamped()
        message.header.stamp = self.probe.node.get_clock().now().to_msg()
        message.twist.linear.x, message.twist.angular.z = linear, angular
        self.cmd_vel.publish(message)

    @property
    def status(self) -> DiagnosticStatus:
        found = [
            s for array in self.reports for s in array.status if s.name == 'walker_node: walker'
        ]
        return found[-1]

    def value(self, key: str) -> str:
        return str(next(each.value for each in self.status.values if each.key == key))

    def until_message(self, text: str) -> None:
        self.probe.until(lambda: self.reports and text in self.status.message)

    def until_walking(self) -> None:
        """Wait for half of the speed: a busy machine may pause before it is reached."""
        assert self.twist is not None
        linear = self.twist[0]
        # Earlier reports are of another motion.
        self.reports.clear()
        self.probe.until(
            lambda: self.reports and float(self.value('linear')) * linear >= 0.5 * linear**2
        )

    def until_steady(self) -> None:
        assert self.twist is not None
        # Earlier reports are of another motion.
        self.reports.clear()
        linear = self.twist[0]
        # A loaded machine ends a command now and then, and it starts again.
        near = 0.02 * abs(linear)
        self.probe.until(
            lambda: self.reports and abs(float(self.value('linear')) - linear) <= near
        )

    def until_stopped(self) -> None:
        # Diagnostics may be earlier than commands.
        self.probe.until(lambda: list(self.commands[-1].velocity) == [0.0, 0.0])
