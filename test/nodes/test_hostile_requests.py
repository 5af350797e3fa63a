"""Hostile messages and requests from the network: a node goes on, and logs little."""

from collections.abc import Callable
from functools import partial

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from geometry_msgs.msg import PointStamped
import pytest
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import GetParameters, SetParameters
from ros_domain import Domain, Process
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

NO_TYPE = ParameterValue(type=77)
LONG = '\x1b[2J' + 'x' * 10**6


def started(ros: Domain, name: str) -> Process:
    start = ros.solver if name == 'solver_node' else partial(ros.start, name)
    process = start(use_sim_time='true')
    ros.probe.until(lambda: 'ready' in process.errors or 'recording to' in process.errors)
    return process


def works(ros: Domain, name: str) -> bool:
    request = GetParameters.Request(names=['use_sim_time'])
    answer = ros.probe.call(GetParameters, f'{name}/get_parameters', request)
    return bool(answer.values[0].bool_value)


@pytest.mark.parametrize('name', ['solver_node', 'crank_node', 'recorder_node'])
def test_a_parameter_of_no_type_and_a_clock_before_1970_end_no_node(
    ros: Domain, name: str
) -> None:
    node = started(ros, name)
    client = ros.probe.node.create_client(SetParameters, f'{name}/set_parameters')
    ros.probe.until(client.service_is_ready)
    clock = ros.probe.publisher(Clock, '/clock', reliable=False)
    for _ in range(3):
        client.call_async(
            SetParameters.Request(parameters=[Parameter(name='use_sim_time', value=NO_TYPE)])
        )
        clock.publish(Clock(clock=Time(sec=-5)))
        ros.probe.spin(0.2)
        assert works(ros, name)
    assert node.stop() == 0
    assert 'Traceback' not in node.errors
    errors = [line for line in node.errors.splitlines() if '[ERROR]' in line]
    assert errors
    assert all('a callback failed, and the node goes on: ValueError' in line for line in errors)


def test_a_solver_answers_cranks_between_bad_clocks(ros: Domain) -> None:
    feet = ros.probe.listen(PointStamped, 'point_h')
    started(ros, 'solver_node')
    crank = ros.probe.publisher(Float64, 'crank_angle')
    clock = ros.probe.publisher(Clock, '/clock', reliable=False)
    ros.probe.await_publishers('point_h')
    for number in range(1, 31):
        clock.publish(Clock(clock=Time(sec=-5)))
        crank.publish(Float64(data=0.1 * number))
        ros.probe.until(lambda: len(feet) == number)  # noqa: B023 - called at once
    valid = Time(sec=42)

    def is_stamped() -> bool:
        # A clock is best effort.
        clock.publish(Clock(clock=valid))
        crank.publish(Float64(data=1.0))
        ros.probe.spin(0.1)
        return bool(feet[-1].header.stamp == valid)

    ros.probe.until(is_stamped)


def test_names_of_a_megabyte_are_cut_wherever_they_are_shown(ros: Domain) -> None:
    reports = ros.probe.listen(DiagnosticArray, '/diagnostics')
    feet = ros.probe.listen(PointStamped, 'point_h')
    solver = ros.solver(diagnostics_period=0.2)
    crank = ros.probe.publisher(JointState, 'crank_state')
    ros.probe.await_publishers('/diagnostics')
    ros.probe.await_publishers('point_h')
    message = JointState(name=[LONG, *(['other'] * 1000)], position=[0.0] * 1001)
    message.header.frame_id = LONG

    def warnings() -> list[DiagnosticStatus]:
        statuses = [status for report in reports for status in report.status]
        return [status for status in statuses if status.level == DiagnosticStatus.WARN]

    def asked_again(answers: Callable[[], object]) -> bool:
        # An input is best effort: of a message of many parts one may be lost.
        crank.publish(message)
        ros.probe.spin(0.5)
        return bool(answers())

    ros.probe.until(lambda: asked_again(warnings))
    assert warnings()[0].message.startswith(
        'crank_state: there is no joint crank among its 1001 ('
    )
    assert warnings()[0].message.isprintable()
    assert len(warnings()[0].message) < 300
    # The same sender, now with a crank.
    message.name[0], message.position[0] = 'crank', 1.0
    ros.probe.until(lambda: asked_again(lambda: feet))
    assert solver.stop() == 0
    warned = [line for line in solver.errors.splitlines() if '[WARN]' in line]
    assert warned
    assert all(len(line) < 400 and line.isprintable() for line in warned)
