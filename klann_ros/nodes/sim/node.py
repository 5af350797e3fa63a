"""`sim_node`: the simulated robot in real time."""

from collections.abc import Sequence
from math import degrees
from time import monotonic
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from klann_ros.dynamics import MassError
from klann_ros.kinematics import KinematicsError
from klann_ros.nodes.endpoints import (
    create_publisher,
    create_steady_timer,
    create_trigger,
    diagnostic_array,
    diagnostic_status,
    QOS_USAGE,
)
from klann_ros.nodes.parameters import declare, require, StartError, usage
from klann_ros.nodes.process import arguments, run
from klann_ros.nodes.raw_executor import RawCallbackGroup
from klann_ros.nodes.solver.leg_parameters import declared_robot
from klann_ros.robot import robot_of
from klann_ros.sanitize.arguments import ArgumentParser
from klann_ros.sanitize.text import printable
from klann_ros.stop_signals import StopSignals
from klann_ros.twin import DivergedError, NoMujocoError, Pace, RealTimeFactor, Twin, TwinError
from rclpy.node import Node
from rclpy.time import Time

from .declarations import DRIVES, floor, motors, OUTPUT, READINGS, sensors, SIM_PARAMETERS, WORLD
from .topics import CrankCommands, DemoCommandPublisher, RobotOutputs, WARNING_PERIOD

# A warning is published below this real-time factor [-].
MIN_REAL_TIME_FACTOR = 0.97
# With shorter steps the engine would never get anywhere [s].
MIN_TIME_STEP = 1e-5


class SimNode(Node):
    """Simulate a robot in real time: crank_command in; cranks, IMU and the truth out."""

    def __init__(self, **options: Any) -> None:
        """Declare, validate, and begin; a StartError names a refused parameter, or no engine."""
        super().__init__('sim_node', **options)
        values = declare(self, SIM_PARAMETERS)
        step, allowed = values['time_step'], f'0, or {MIN_TIME_STEP:g} .. 0.005'
        require(step == 0.0 or step >= MIN_TIME_STEP, 'time_step', step, allowed)
        self._twin = self._make_twin(values)
        self._period = 1.0 / values['rate']
        self._commands = CrankCommands(self, self._twin, values['command_timeout'])
        self._outputs = RobotOutputs(
            self,
            self._twin,
            sensors(values),
            world=values['world_frame'],
            base=values['base_frame'],
            with_clock=values['use_clock'],
            with_cameras=values['cameras'],
        )
        # The number of ticks, and the tick of the robot's start.
        self._tick = self._first = 0
        self._resets = 0
        # The last fault since the last report.
        self._fault = ''
        # Simulated time begins with 0, or with now.
        self._origin = 0 if values['use_clock'] else self.get_clock().now().nanoseconds
        self._diagnostics = create_publisher(self, DiagnosticArray, '/diagnostics')
        create_trigger(self, 'reset', self._on_reset)
        if values['linear']:
            DemoCommandPublisher(self, values['linear'], lambda: self._twin.time)
        self._factor = values['real_time_factor']
        require(
            values['use_clock'] or self._factor == 1.0,
            'real_time_factor',
            self._factor,
            '1 without use_clock',
        )
        self._pace = Pace(self._period, self._factor, monotonic())
        period = self._period / max(1.0, self._factor)
        create_steady_timer(self, period, self._on_timer, RawCallbackGroup())
        create_steady_timer(self, values['diagnostics_period'], self._report)
        self.get_logger().info(f'ready: {self._twin.summary}, by {self._commands.topic}')

    def _make_twin(self, values: dict[str, Any]) -> Twin:
        robot = declared_robot(self)
        try:
            if values['built']:
                robot = robot.built_as(robot_of(values['built']))
        except ValueError as error:
            raise StartError(f'built: {error}') from error
        try:
            return Twin(
                robot,
                floor=floor(values),
                motors=motors(values, robot.crank_joints),
                sensors=sensors(values),
                time_step=values['time_step'],
                seed=values['seed'],
            )
        except (MassError, TwinError, NoMujocoError, KinematicsError) as error:
            raise StartError(str(error)) from error

    def _on_timer(self) -> None:
        for _ in range(self._pace.due(monotonic())):
            self._commands.expire_commands()
            self._tick += 1
            try:
                self._twin.step((self._tick - self._first) * self._period)
            except DivergedError as error:
                self._fault = f'{error}; the robot is put back to its start'
                self.get_logger().error(self._fault, throttle_duration_sec=WARNING_PERIOD)
                self._reset()
            self._outputs.publish(self._stamp())

    def _stamp(self) -> Any:
        """Return simulated time, or the world's, which stands still for no late tick."""
        seconds = self._tick * self._period + (self._pace.slipped if self._origin else 0.0)
        return Time(nanoseconds=self._origin + round(seconds * 1e9)).to_msg()

    def _reset(self) -> None:
        self._twin.reset()
        self._commands.forget()
        self._first = self._tick
        self._resets += 1

    def _on_reset(self) -> tuple[bool, str]:
        self._reset()
        return True, 'the robot stands where it began, its cranks held'

    def _report(self) -> None:
        factor = self._pace.factor(monotonic())
        level, message = self._verdict(factor)
        values = {
            'time': f'{self._tick * self._period:.3f}',
            'real_time_factor': f'{factor.factor:.3f}',
            'given_up': f'{self._pace.slipped:.3f}',
            'tilt': f'{degrees(self._twin.tilt):.2f}',
            'resets': self._resets,
            **self._commands.counts,
        }
        status = diagnostic_status(self, 'simulation', level, message, values.items())
        self._diagnostics.publish(diagnostic_array(self, [status]))

    def _verdict(self, factor: RealTimeFactor) -> tuple[bytes, str]:
        """Return the level and the most important message."""
        if self._fault:
            fault, self._fault = self._fault, ''
            return DiagnosticStatus.ERROR, fault
        if self._twin.state:
            return DiagnosticStatus.ERROR, self._twin.state
        if factor.share < MIN_REAL_TIME_FACTOR:
            rates = f'{factor.factor:.2f} of real time, {self._factor:g} is requested'
            return DiagnosticStatus.WARN, f'it cannot keep up: {rates}'
        silent = self._commands.silent
        if silent:
            held = ', '.join(map(printable, silent))
            return DiagnosticStatus.OK, f'no command: {held} held'
        return DiagnosticStatus.OK, 'simulated in real time'


def main(argv: Sequence[str], stop: StopSignals) -> int:
    """Run the node; return the exit code."""
    groups = {
        'the world': WORLD,
        'motors': DRIVES,
        'sensors': READINGS,
        'outputs': OUTPUT,
    }
    parser = ArgumentParser(
        'sim_node',
        'Simulate a robot in MuJoCo, in real time: speeds of its cranks in (crank_command), its '
        'cranks (crank_state), its IMU (imu) and its true pose (ground_truth) out.',
        f'{usage(groups)}\n its legs and masses: those of solver_node, in the same file\n'
        f'{QOS_USAGE}\n\n'
        'Service ~/reset (std_srvs/srv/Trigger): the robot stands where it began.',
    )
    arguments(parser, argv)
    return run('sim_node', lambda _: SimNode(), argv, stop, raw=True)
