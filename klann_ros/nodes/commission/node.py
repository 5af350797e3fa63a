"""`commission_node`: turns each crank a little, and says how its motor and encoder are wired."""

import argparse
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from math import degrees
from pathlib import Path
from typing import Any

from klann_ros.cli import ArgumentParser, Output, OutputError
from klann_ros.gait import Feet, NoWalkerError
from klann_ros.messages import JointReading
from klann_ros.nodes.clocks import ControlClock
from klann_ros.nodes.crank_output import COMMAND_TYPE, CrankOutput
from klann_ros.nodes.encoders import subscribe_cranks
from klann_ros.nodes.endpoints import create_steady_timer, other_publishers, QOS_USAGE, TypeCheck
from klann_ros.nodes.keyboard import Keyboard
from klann_ros.nodes.leg_declarations import ENCODER_REMEDIES, ENCODERS
from klann_ros.nodes.parameters import declare, number, require, StartError, usage
from klann_ros.nodes.process import arguments, Finish, parameter_files, ProcessNode, run
from klann_ros.nodes.raw_executor import Info
from klann_ros.nodes.robot_parameters import declared_robot
from klann_ros.robot import CrankDrive, Robot
from klann_ros.sanitize.text import printable, printable_line
from klann_ros.sanitize.yaml_text import parameter_file
from klann_ros.stop_signals import StopSignals
from klann_ros.walker import Commissioning, CommissioningSettings, CrankCommand, CrankDrives, Rates
from rclpy.qos import qos_profile_sensor_data
from sensor_msgs.msg import Imu
from std_msgs.msg import Bool

_SETTINGS = CommissioningSettings()
COMMISSION_PARAMETERS = (
    *ENCODERS,
    number('angle', round(_SETTINGS.angle, 4), 'each crank turns so far [rad]', 0.02, 0.6),
    number('rate', _SETTINGS.rate, 'so fast [rad/s]', 0.02, 1.0),
    number(
        'max_angle',
        round(_SETTINGS.max_angle, 4),
        'a turn ends where an encoder turns by more [rad]',
        0.02,
        1000.0,
    ),
    number('feedback_timeout', _SETTINGS.timeout, 'or is silent for longer [s]', 0.05, 5.0),
    replace(COMMAND_TYPE, description='type of crank_command, as of walker_node'),
)
# Period of the commands [s].
PERIOD = 0.01
# Time in which other nodes are discovered before a crank turns [s].
DISCOVERY_TIME = 2.0
# Time for which a driver is waited for [s].
DRIVER_TIMEOUT = 10.0


class StartPermission:
    """The user's permission to turn the cranks: the space bar gives and withdraws it."""

    def __init__(self, *, is_given: bool) -> None:
        self.is_given = is_given
        self.is_withdrawn = False
        self._is_requested = False
        self._keyboard = Keyboard()
        self._keyboard.start(self._on_key, lambda: None)

    def request(self, joints: Sequence[str], angle: float) -> None:
        """Say once which joints will turn, and by which angle [rad]."""
        if self._is_requested:
            return
        self._is_requested = True
        print(
            f'{", ".join(map(printable, joints))} will turn by {degrees(angle):.0f} deg, '
            'one after the other, '
            'forwards first (feet on the ground go back) and then back. Look which way.\n'
            'Keep clear. The space bar begins, and stops.',
            flush=True,
        )

    def close(self) -> None:
        """Restore the terminal."""
        self._keyboard.close()

    def _on_key(self, key: str) -> None:
        if key == 'space':
            self.is_withdrawn = self.is_given
            self.is_given = self.is_given or self._is_requested


class CommissionNode(ProcessNode):
    """Turn each crank a little, and judge the answers; the report is printed."""

    def __init__(self, options: argparse.Namespace, finish: Finish) -> None:
        """Declare, validate and connect; a StartError names a refused argument."""
        super().__init__('commission_node')
        parameters = declare(self, COMMISSION_PARAMETERS)
        robot = declared_robot(self, described=True)
        self._joints = robot.crank_joints
        for joint in set(options.backwards or ()) - {'none'}:
            requirement = f'of {", ".join(self._joints)}, or none'
            require(joint in self._joints, '--backwards', joint, requirement)
        self._output_path: str | None = options.output
        self._finish = finish
        self._is_complete = False
        self._angle: float = parameters['angle']
        settings = CommissioningSettings(
            self._angle,
            parameters['max_angle'],
            parameters['rate'],
            timeout=parameters['feedback_timeout'],
        )
        self._commissioning = Commissioning(self._joints, settings, options.backwards)
        # The rates of the cranks, step by step.
        self._steps = self._procedure(robot, options)
        drives = CrankDrives(dict.fromkeys(self._joints, CrankDrive()))
        self._commands = CrankOutput(self, drives, parameters['command_type'])
        self._types = TypeCheck(self, ENCODER_REMEDIES)
        subscribe_cranks(self, self._joints, parameters, self._on_crank_state)
        self.create_subscription(Imu, 'imu', self._on_imu, qos_profile_sensor_data)
        # In a simulation the time of its motors, which is slow on a busy machine.
        self._clock = ControlClock(self)
        self._start_time = self._clock.now()
        self._has_feedback = False
        # The crank whose turn was announced last.
        self._announced = ''
        self._permission = StartPermission(is_given=options.yes)
        create_steady_timer(self, PERIOD, self._on_timer)

    def close(self) -> int:
        """Stop the cranks, and restore the terminal; 1 if a signal came before the report."""
        self._commands.end(self._command({}), 0, 0)
        self._permission.close()
        return 0 if self._is_complete else 1

    def on_callback_error(self) -> None:
        """Stop the cranks: the failed step would count as the last one."""
        if not self._is_complete:
            with suppress(OSError):  # of a closed pipe, which may be what failed
                self._end('it failed, as its log says: nothing is written')
        self._finish(1)

    def _procedure(self, robot: Robot, options: argparse.Namespace) -> Iterator[Rates]:
        """Subscribe to the home switches, and return the steps of all turns."""
        is_closed = dict.fromkeys(self._joints if options.home else (), False)

        def on_switch(joint: str, message: Bool) -> None:
            is_closed[joint] = message.data

        for joint in is_closed:
            topic = f'{options.home}/{joint}'
            self.create_subscription(Bool, topic, partial(on_switch, joint), 10)
        feet = None
        with suppress(NoWalkerError):
            feet = Feet(robot)
        commissioning = self._commissioning

        def steps() -> Iterator[Rates]:
            yield from commissioning.turn_all()
            commissioning.judge_imu(feet)
            if options.zero:
                commissioning.set_zero()
            for joint in is_closed:
                if joint in commissioning.drives:
                    yield from commissioning.home(joint, partial(is_closed.__getitem__, joint))

        return steps()

    def _command(self, rates: Rates) -> CrankCommand:
        velocities = tuple(rates.get(joint, 0.0) for joint in self._joints)
        return CrankCommand((0.0,) * len(velocities), velocities)

    def _on_crank_state(self, readings: Mapping[str, JointReading], info: Info) -> None:
        self._commissioning.now = self._clock.now()
        self._has_feedback = True
        encoders = {joint: (r.position, r.velocity) for joint, r in readings.items()}
        # All readings of a message have its stamp.
        reading = next(iter(readings.values()))
        stamp = reading.sec + reading.nanosec / 1e9 or info['source_timestamp'] / 1e9
        self._commissioning.feedback(encoders, stamp)

    def _on_imu(self, message: Imu) -> None:
        self._commissioning.now = self._clock.now()
        force, rates = message.linear_acceleration, message.angular_velocity
        self._commissioning.imu((force.x, force.y, force.z), (rates.x, rates.y, rates.z))

    def _on_timer(self) -> None:
        # The executor may end a little later.
        if self._is_complete:
            return
        self._types.check()
        now = self._commissioning.now = self._clock.now()
        problem = self._problem(now)
        if problem:
            self._end(problem)
        elif not self._has_feedback or now - self._start_time <= DISCOVERY_TIME:
            return
        elif self._permission.is_given:
            self._step()
        else:
            self._permission.request(self._joints, self._angle)

    def _problem(self, now: float) -> str:
        """Return why no crank may turn, '' if it may."""
        waiting_time = now - self._start_time
        topic = self.resolve_topic_name('crank_command')
        # Before their names: one that appears in between is then named.
        is_alone = self.count_publishers(topic) <= 1
        publishers = other_publishers(self, topic)
        # Discovery knows a publisher before its node; no crank turns before its end.
        is_discovered = '' not in publishers or waiting_time > DISCOVERY_TIME
        if is_discovered and (publishers or not is_alone):
            names = ', '.join(sorted(publishers)) or 'another node of this name'
            return f'{printable_line(names)} publishes {topic}: end it first'
        if self._permission.is_withdrawn:
            return 'stopped by a key'
        if not self._has_feedback and waiting_time > DRIVER_TIMEOUT:
            return f'no crank_state of {", ".join(map(printable, self._joints))}: start the driver'
        return ''

    def _step(self) -> None:
        """Command the next rates, and print which crank begins to turn."""
        rates = next(self._steps, None)
        if rates is None:
            self._end('')
            return
        for joint in rates:
            if joint != self._announced:
                print(f'{printable(joint)} turns', flush=True)
            self._announced = joint
        self._commands.publish(self._command(rates), 0, 0)

    def _end(self, problem: str) -> None:
        """Stop the cranks, report, write, and finish."""
        self._commands.publish(self._command({}), 0, 0)
        self._is_complete = True
        for finding in self._commissioning.findings:
            print(printable_line(f'{finding.subject}: {finding.verdict.value}: {finding.text}'))
        problem = problem or self._commissioning.problem
        if problem:
            print(f'commission_node: {problem}', flush=True)
        elif self._output_path:
            problem = self._write(self._output_path)
        self._finish(1 if problem else 0)

    def _write(self, path: str) -> str:
        """Write the measured drives; return the reason of a failure, '' if they are written."""
        text = parameter_file({'/**': {'cranks': self._commissioning.cranks}})
        try:
            Output('-o', path).write(text.encode())
        except OutputError as error:
            print(f'commission_node: {error}; it would be\n{text}', flush=True)
            return str(error)
        print(f'{printable(path)}: a second --params-file, after that of the robot')
        return ''


def main(argv: Sequence[str], stop: StopSignals) -> int:
    """Run the node; return the exit code."""
    parser = ArgumentParser(
        'commission_node',
        'Turn each crank of a robot by a small angle, one after the other, forwards and back '
        '(crank_command), and say by its encoder (crank_state) and the IMU (imu) what is wired '
        'wrongly. THE CRANKS MOVE: with --home by up to a turn. The space bar stops them, and '
        'Ctrl-C. Exit code 0: all cranks can walk, 1: repair first.',
        f'{usage({"": COMMISSION_PARAMETERS})}\n its legs: those of solver_node, in the same '
        f'file\n{QOS_USAGE}',
    )
    parser.add_argument('--yes', action='store_true', help='begin without asking')
    parser.add_argument(
        '--backwards',
        nargs='+',
        metavar='JOINT',
        help='joints that you saw turn backwards first, or none: an encoder cannot tell',
    )
    parser.add_argument('--zero', action='store_true', help='the cranks are at their zeros now')
    parser.add_argument(
        '--home',
        metavar='TOPIC',
        help='turn each crank forwards until TOPIC/JOINT (std_msgs/Bool) becomes true: its zero',
    )
    parser.add_argument('-o', '--output', metavar='FILE', help='write what was measured')
    parser.add_argument('--overwrite', action='store_true', help='even if FILE exists')
    options = arguments(parser, argv)
    if options.output and not options.overwrite and Path(options.output).exists():
        parser.error(f'{printable(options.output)} exists already: --overwrite replaces it')
    if options.output is not None:
        try:
            # Before a crank turns; the robot's file, which may be named here, is only read.
            Output('-o', options.output).check(parameter_files(argv))
        except OutputError as error:
            parser.error(str(error))
    return run('commission_node', partial(_make, options), argv, stop, raw=True)


def _make(options: argparse.Namespace, finish: Finish) -> Any:
    if not options.yes and not Keyboard().is_available:
        raise StartError('there is no terminal to ask: --yes turns the cranks without a question')
    return CommissionNode(options, finish)
