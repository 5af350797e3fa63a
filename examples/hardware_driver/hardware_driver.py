"""
A motor driver for walker_node, to copy: crank_command in, crank_state out.

    python3 hardware_driver.py --ros-args -p port:=/dev/ttyUSB0     without a port it simulates

docs/hardware.md gives the reasons: what walker_node expects of any driver.
"""

from contextlib import suppress
from math import inf, isfinite
import signal
import sys
from time import monotonic
from typing import Any

from motors import Motors, SimulatedMotors
import rclpy
from rclpy.duration import Duration
from rclpy.exceptions import ParameterException
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.time import Time
from sensor_msgs.msg import JointState


class HardwareDriver(Node):
    """Turn motors as commanded, and publish the angles of their cranks."""

    def __init__(self) -> None:
        """Open the motors, which stand until the first command."""
        super().__init__('hardware_driver')
        self._joints = self._parameter('joints', ['left_crank', 'right_crank'])
        count = len(self._joints)
        # Turns of the shaft for one of the crank; negative where it turns the other way.
        self._ratios = self._parameter('gear_ratios', [1.0] * count)
        # Angle of the crank where the encoder reads 0 [rad].
        self._zeros = self._parameter('zeros', [0.0] * count)
        self._timeout = self._parameter('command_timeout', 0.5)
        rate = self._parameter('rate', 100.0)
        numbers = (*self._ratios, *self._zeros, self._timeout, rate)
        has_sizes = len(self._ratios) == len(self._zeros) == count
        if not (has_sizes and all(self._ratios) and all(map(isfinite, numbers)) and rate > 0.0):
            needed = 'a gear ratio other than 0 and a zero, and a rate above 0'
            raise ValueError(f'{self._joints} need each {needed}; all are finite')
        self._motors = motors_of(self._parameter('port', ''), count)
        self._motors.connect()
        # Commanded rates of the cranks [rad/s], and the arrival of the command [s].
        self._rates, self._commanded = [0.0] * count, -inf
        self._states = self.create_publisher(JointState, 'crank_state', 10)
        # A queue of one: after a pause only the last command counts.
        self.create_subscription(JointState, 'crank_command', self._on_command, 1)
        self.create_timer(1.0 / rate, self._on_timer)

    def _parameter(self, name: str, default: Any) -> Any:
        return self.declare_parameter(name, default).value

    def _on_command(self, message: JointState) -> None:
        velocities = dict(zip(message.name, message.velocity, strict=False))
        rates = [velocities.get(joint, inf) for joint in self._joints]
        age = self.get_clock().now() - Time.from_msg(message.header.stamp)
        has_stamp = message.header.stamp != type(message.header.stamp)()
        if has_stamp and abs(age.nanoseconds) / 1e9 > self._timeout:
            self._refuse(f'it is {age.nanoseconds / 1e9:.1f} s old: are the clocks the same?')
        elif not all(map(isfinite, rates)):
            self._refuse(f'it has no finite velocity of each of {self._joints}')
        else:
            self._rates, self._commanded = rates, monotonic()

    def _refuse(self, reason: str) -> None:
        text = f'crank_command is refused: {reason}'
        self.get_logger().warning(text, throttle_duration_sec=2.0)

    def _on_timer(self) -> None:
        if monotonic() - self._commanded > self._timeout:
            self._rates = [0.0] * len(self._rates)
        # Also where nothing has changed: the motors' own watchdog waits for it.
        self._write(self._rates)
        reading = self._motors.read_angles()
        if reading is None:
            # An old angle is no feedback: walker_node stops where none comes.
            return
        message = JointState(name=self._joints)
        age = Duration(seconds=monotonic() - reading.time)
        message.header.stamp = (self.get_clock().now() - age).to_msg()
        parts = zip(reading.angles, self._ratios, self._zeros, strict=True)
        message.position = [angle / ratio + zero for angle, ratio, zero in parts]
        self._states.publish(message)

    def _write(self, rates: list[float]) -> None:
        pairs = zip(rates, self._ratios, strict=True)
        self._motors.write_rates([rate * ratio for rate, ratio in pairs])

    def stop(self) -> None:
        """Stop the motors, if they can still be reached."""
        with suppress(OSError):
            self._write([0.0] * len(self._rates))


def motors_of(port: str, count: int) -> Motors:
    """Return the motors on a serial port; without a port simulated ones."""
    if not port:
        return SimulatedMotors(count)
    from serial_motors import SerialMotors  # noqa: PLC0415 - simulated ones need no pyserial

    return SerialMotors(port, count)


def main() -> None:
    """Drive until a signal, or until the port is gone."""
    # A handler of rclpy's would end the context in the middle of a callback.
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    signals: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, lambda number, _: signals.append(number))
    driver = None
    try:
        driver = HardwareDriver()
        while not signals:
            rclpy.spin_once(driver, timeout_sec=0.1)
    except ImportError as error:
        sys.exit(f'hardware_driver: {error}: run pip install pyserial')
    except (OSError, ValueError, ParameterException) as error:
        sys.exit(f'hardware_driver: {error}')
    finally:
        if driver is not None:
            driver.stop()


if __name__ == '__main__':
    main()
