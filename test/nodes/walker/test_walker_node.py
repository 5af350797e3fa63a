"""walker_node as a process, with motors that the test turns."""

from itertools import pairwise
from math import copysign, degrees, nan
from signal import SIGCONT, SIGSTOP
from time import sleep, time_ns

from crank_motors import CONFIG, JOINTS, Motors, TWO_MOTORS
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Twist, TwistStamped
from klann_ros.nodes.endpoints import LATCHED
from klann_ros.nodes.walker.node import WalkerNode
from klann_ros.nodes.walker.timing import Beat
from nav_msgs.msg import Odometry
import pytest
from ros_domain import Domain, Process
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Bool, Float64MultiArray, String


@pytest.fixture(scope='module')
def ros(module_ros: Domain) -> Domain:
    return module_ros


@pytest.fixture(scope='module')
def walker(ros: Domain) -> Process:
    parameters = {'use_imu': True, 'diagnostics_period': 0.1, 'publish_tf': False}
    return ros.start('walker_node', '--ros-args', '--params-file', TWO_MOTORS, **parameters)


@pytest.fixture(scope='module')
def motors(ros: Domain, walker: Process) -> Motors:  # noqa: ARG001 - it is there first
    return Motors(ros)


@pytest.mark.parametrize(
    ('rate', 'min_count', 'max_count'),
    [(100.0, 99, 101), (150.0, 97, 101), (500.0, 97, 101), (40.0, 40, 41)],
)
def test_a_beat_is_kept_in_the_mean_and_never_exceeded(
    rate: float, min_count: int, max_count: int
) -> None:
    beat = Beat(0.01)
    # Every other message comes late.
    times = [5000.0 + (k + 0.2 * (k % 2)) / rate for k in range(round(rate))]
    assert min_count <= sum(map(beat.take, times)) <= max_count
    # Whatever the clock does, it goes on.
    assert beat.take(times[-1] - 1000.0)
    assert beat.take(times[-1])


def test_a_walk(ros: Domain, walker: Process, motors: Motors) -> None:
    # One process, and one story: what each chapter leaves is where the next begins.
    motors.until_message('standing')
    motors.twist = (0.15, 0.0)
    motors.until_message('walking')
    ros.probe.until(lambda: motors.odom[-1].pose.pose.position.x > 0.3)
    odom = motors.odom[-1]
    assert (odom.header.frame_id, odom.child_frame_id) == ('odom', 'base_link')
    assert odom.pose.pose.position.z == pytest.approx(0.31, abs=0.02)
    assert odom.pose.covariance[0] > 0.0
    # The variances of height and tilt.
    assert odom.pose.covariance[14::7] == pytest.approx(
        [1e-4, 4e-4, 4e-4, odom.pose.covariance[35]]
    )
    assert odom.twist.covariance[35] > 0.0
    assert list(motors.commands[-1].name) == JOINTS
    # A motor that is 10 % slow is in phase all the same.
    assert degrees(abs(motors.positions[0] - motors.positions[1])) < 8.0
    assert float(motors.value('static_margin')) >= 0.0
    assert len(motors.value('supporting_feet').split()) == 3

    motors.send(nan, 0.0)
    ros.probe.until(lambda: motors.value('cmd_vel_rejected') == '1')
    assert 'not finite' in walker.errors

    imu = ros.probe.publisher(Imu, 'imu')
    turning = Imu()
    turning.header.frame_id = 'imu_link'
    turning.orientation.w = turning.orientation.z = 0.5**0.5
    turning.angular_velocity.z = 0.25
    imu.publish(turning)
    ros.probe.until(lambda: motors.odom[-1].twist.twist.angular.z == 0.25)
    assert 'imu is in frame imu_link: its axes are taken as those of base_link' in walker.errors
    imu.publish(Imu(angular_velocity=turning.angular_velocity))
    ros.probe.until(lambda: motors.value('imu') == 'none')

    motors.silent = {1}
    motors.until_message('no valid feedback of right_crank')
    motors.until_stopped()
    motors.silent = set()
    motors.until_message('walking')

    rival = ros.probe.publisher(JointState, 'crank_command')
    motors.until_message('crank_command has 2 publishers')
    assert walker.errors.count('only one may drive the cranks') == 1
    ros.probe.node.destroy_publisher(rival)

    driver = ros.other_node()
    twists = driver.create_publisher(TwistStamped, 'cmd_vel', 10)
    motors.until_message('cmd_vel has 2 publishers: /probe, /probe')
    assert motors.status.level == DiagnosticStatus.WARN
    driver.destroy_publisher(twists)
    for number in (1, 2):
        ros.other_node().create_publisher(Bool, 'e_stop', 10)
        motors.until_message(
            'walking' if number == 1 else 'e_stop has 2 publishers, whose silence'
        )
    assert motors.status.level == DiagnosticStatus.WARN

    motors.factors = [1.0, 1.0]
    motors.twist = None
    motors.until_message('standing: no cmd_vel')
    motors.until_stopped()


@pytest.mark.parametrize(
    ('seconds', 'twist', 'ends'),
    [
        (0.3, (0.1, 0.0), False),
        (1.5, (-0.1, 0.05), True),
    ],
)
def test_a_resumed_process_starts_at_the_measured_crank_angles(
    walker: Process, motors: Motors, seconds: float, twist: tuple[float, float], ends: bool
) -> None:
    probe = motors.probe
    linear = twist[0]
    motors.twist = twist
    motors.until_walking()
    pause_count = walker.errors.count('was paused for')
    command_count = len(motors.commands)
    walker.popen.send_signal(SIGSTOP)
    # These commands wait in the queue.
    probe.spin(0.1)
    if ends:
        motors.twist = None
    probe.spin(seconds)
    resumed = time_ns()
    walker.popen.send_signal(SIGCONT)
    probe.until(lambda: walker.errors.count('was paused for') > pause_count)
    commands = list[JointState]()

    def has_commanded() -> bool:
        new_commands = motors.commands[command_count:]
        commands[:] = [command for command in new_commands if _nanoseconds(command) > resumed]
        return len(commands) >= 60

    # Enough to reach its speed again; the next case shows that it does.
    probe.until(has_commanded)
    # The signal may have interrupted the first one.
    assert any(
        tuple(command.position) in motors.measured and list(command.velocity) == [0.0, 0.0]
        for command in commands[:2]
    )
    # 1 for the commanded rate, at 0.148 m/s for 1 rad/s; 0.4 for a slow motor, 1 to make up an
    # error; feedback of the motion; phases.
    fastest = 2.4 * 1.5 * 1.1 * abs(linear) / 0.148
    for last_command, command in pairwise(commands):
        assert not (ends and any(command.velocity))
        if not twist[1]:
            assert all(0.0 <= copysign(u, u * linear) <= fastest for u in command.velocity)
        # Set points restart again where the machine is busy.
        if tuple(command.position) not in motors.measured:
            positions = zip(command.position, last_command.position, strict=True)
            moves = [position - last_position for position, last_position in positions]
            # In a curve a side may turn back, as its set point does; those of both never do.
            assert sum(moves) * linear >= -1e-9
            assert all(u * move >= -1e-9 for u, move in zip(command.velocity, moves, strict=True))
    motors.twist = None


def _nanoseconds(message: JointState) -> int:
    return int(message.header.stamp.sec) * 10**9 + int(message.header.stamp.nanosec)


def test_limits_and_gains_change_while_it_walks(
    ros: Domain, walker: Process, motors: Motors
) -> None:
    assert walker.popen.poll() is None

    def refusal(name: str, setting: object) -> str:
        answer = ros.probe.set_parameters('walker_node', {name: setting})
        assert answer.successful == (not answer.reason)
        return str(answer.reason)

    motors.twist = (0.15, 0.0)
    motors.until_steady()
    assert refusal('max_linear', 0.08) == ''
    ros.probe.until(lambda: motors.value('limits_hit') == 'max_linear')
    ros.probe.until(lambda: motors.value('linear') == '0.0800')
    assert 'within 0 .. 100' in refusal('max_linear', nan)
    assert 'Wrong parameter type' in refusal('max_linear', 'fast')
    # YAML, and so ros2 param, takes this for a text.
    assert refusal('max_linear', '3e-1') == ''
    motors.until_steady()
    assert 'read-only' in refusal('rate', 50.0)
    assert refusal('rate', 100) == ''
    motors.twist = None


def test_an_interrupt_ends_it(walker: Process) -> None:
    assert walker.stop() == 0
    assert 'Traceback' not in walker.errors


def test_a_simulation_that_stands_still_stops_it(ros: Domain) -> None:
    words = ['--ros-args', '--params-file', TWO_MOTORS, '-r', '__ns:=/still']
    node = ros.start('walker_node', *words, use_sim_time=True, diagnostics_period=0.1)
    probe = ros.probe
    commands = probe.listen(JointState, '/still/crank_command')
    state = probe.publisher(JointState, '/still/crank_state')
    cmd_vel = probe.publisher(TwistStamped, '/still/cmd_vel')
    clock = probe.publisher(Clock, '/clock')
    time = Clock()

    def walks() -> bool:
        time.clock.nanosec += 10_000_000
        clock.publish(time)
        position = commands[-1].position if commands else [0.0, 0.0]
        state.publish(JointState(name=JOINTS, position=position, velocity=[0.5, 0.5]))
        twist = TwistStamped()
        twist.twist.linear.x = 0.1
        cmd_vel.publish(twist)
        return bool(commands and min(commands[-1].velocity) > 0.3)

    probe.until(walks)
    probe.until(lambda: list(commands[-1].velocity) == [0.0, 0.0])
    assert node.stop() == 0


def test_rates_alone_on_one_crank_that_refuses_to_turn(ros: Domain) -> None:
    file = str(CONFIG / 'walker6.yaml')
    words = ['--ros-args', '--params-file', file, '-r', '__ns:=/one']
    node = ros.start('walker_node', *words, stamped_cmd_vel=False, command_type='velocities')
    probe = ros.probe
    rates = probe.listen(Float64MultiArray, '/one/crank_command')
    state = probe.publisher(JointState, '/one/crank_state')
    cmd_vel = probe.publisher(Twist, '/one/cmd_vel')
    twist = Twist()
    twist.linear.x, twist.angular.z = 0.1, 0.3

    def turned() -> bool:
        state.publish(JointState(name=['crank'], position=[0.5], velocity=[0.4]))
        cmd_vel.publish(twist)
        return bool(rates and rates[-1].data[0] > 0.5)

    probe.until(turned)
    assert len(rates[-1].data) == 1
    assert node.stop() == 0
    assert node.errors.count('angular.z is refused: it cannot turn') == 1


def test_an_imu_without_stamps_is_of_the_times_of_sending(ros: Domain) -> None:
    probe = ros.probe
    # In this process nothing is lost while messages wait, however long.
    words = ['--ros-args', '--params-file', TWO_MOTORS, '-r', '__ns:=/unstamped']
    probe.add(WalkerNode, cli_args=[*words, '-p', 'use_imu:=true'])
    odom = probe.listen(Odometry, '/unstamped/odom')
    state = probe.publisher(JointState, '/unstamped/crank_state')
    imus = probe.publisher(Imu, '/unstamped/imu')
    imu = Imu()
    imu.orientation_covariance[0] = -1.0
    imu.linear_acceleration.z = 9.81
    imu.angular_velocity.z = 0.5
    for _ in range(60):
        imus.publish(imu)
        state.publish(JointState(name=JOINTS, position=[0.0, 0.0], velocity=[0.0, 0.0]))
        sleep(0.01)
    # All of these waited, and are received at once.
    probe.until(lambda: odom and odom[-1].pose.pose.orientation.z > 0.1)


def test_a_walker_without_a_file_is_the_one_that_the_solver_describes(ros: Domain) -> None:
    file = ['--ros-args', '--params-file', TWO_MOTORS]
    ros.start('solver_node', *file)
    described = ros.start('walker_node')
    ros.probe.until(lambda: 'ready: ' in described.errors)
    with_file = ros.start('walker_node', *file, '-r', '__ns:=/with_file')
    ros.probe.until(lambda: 'ready: ' in with_file.errors)
    of_file, of_topic = (
        process.errors.partition('ready: ')[2].partition(';')[0]
        for process in (with_file, described)
    )
    assert of_topic == of_file


def test_a_described_robot_is_refused_as_a_files(ros: Domain) -> None:
    publisher = ros.probe.node.create_publisher(String, '/other/leg_description', LATCHED)
    publisher.publish(String(data='/s: {ros__parameters: {linkage: /dev/zero, legs: [a]}}'))
    node = ros.start('walker_node', '--ros-args', '-r', '__ns:=/other')
    assert node.wait() == 1
    assert 'it has 1 leg' in node.errors
