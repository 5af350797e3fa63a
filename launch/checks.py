"""
What ends a launch: at once, when something is missing; later, when a node of klann_ros fails.

The other launch files include it before they start anything: whatever can be missing or misspelt
is looked for here, and told in one line. A process that fails is no error to launch: here it is.
"""

import asyncio
from collections.abc import Iterator
import os
from pathlib import Path
import shutil

from ament_index_python.packages import PackageNotFoundError
from launch import LaunchContext, LaunchDescription
from launch.actions import OpaqueFunction, RegisterEventHandler
from launch.event_handlers import OnProcessExit, OnShutdown
from launch.events import Shutdown
from launch.events.process import ProcessExited
from launch.substitutions import SubstitutionFailure
from launch_ros.actions import Node
from launch_ros.substitutions import ExecutableInPackage


def programs(given: dict[str, str]) -> Iterator[tuple[str, str, str]]:
    """Yield the programs of others that will be started: what needs them, package, executable."""
    if given.get('linkage'):
        yield 'linkage:=FILE', 'tf2_ros', 'static_transform_publisher'
    else:
        yield 'a leg with a URDF', 'robot_state_publisher', 'robot_state_publisher'
        yield 'a leg with a URDF', 'xacro', 'xacro'
    if 'sim' in given:  # an argument of ros2_control.launch.py alone
        yield 'ros2_control', 'controller_manager', 'ros2_control_node'
        yield 'ros2_control', 'controller_manager', 'spawner'
    if asked(given, 'rviz'):
        yield 'rviz:=true', 'rviz2', 'rviz2'
    if asked(given, 'slider'):
        yield 'slider:=true', 'joint_state_publisher_gui', 'joint_state_publisher_gui'


def files(given: dict[str, str]) -> Iterator[str]:
    """Yield the arguments that name a file which will be read."""
    if 'params_file' in given:  # nobody gives it to the checks alone
        yield 'params_file'
    if given.get('linkage'):
        yield 'linkage'
    if asked(given, 'rviz'):
        yield 'rviz_config'


def asked(given: dict[str, str], flag: str) -> bool:
    """Tell whether a flag is set; one that this launch does not have is not."""
    return given.get(flag, 'false').lower() == 'true'


def is_installed(package: str, executable: str, context: LaunchContext) -> bool:
    """Tell whether a program is there, where launch_ros or a shell looks for it."""
    if package == 'xacro':
        return shutil.which(executable) is not None
    try:
        ExecutableInPackage(package=package, executable=executable).perform(context)
    except (PackageNotFoundError, SubstitutionFailure):
        return False
    return True


def check(context: LaunchContext) -> None:
    """Refuse what cannot work, while nothing is started."""
    given = context.launch_configurations
    for what, package, executable in programs(given):
        if not is_installed(package, executable, context):
            debian = f'ros-{os.environ.get("ROS_DISTRO", "jazzy")}-{package.replace("_", "-")}'
            raise RuntimeError(f'{what} needs {package}: sudo apt install {debian}')
    for name in files(given):
        # A relative path starts where the user is.
        path = Path(given[name])
        if not path.is_file():
            reason = 'it is no plain file' if path.exists() else 'there is no such file'
            raise RuntimeError(f'{name}:={path}: {reason}')


def end_if_failed(event: ProcessExited, context: LaunchContext) -> None:
    """End the launch when a node of klann_ros has failed; others, such as RViz, may."""
    node = event.action
    if not isinstance(node, Node) or node.node_package != 'klann_ros' or not event.returncode:
        return
    # Once everything ends, only a run that is not finished matters: whoever is interrupted while
    # its Python starts, fails as well.
    if not context.is_shutdown or node.node_executable == 'recorder_node':
        name = node.node_name.lstrip('/')
        raise RuntimeError(f'{name} has failed, exit code {event.returncode}; the launch ends')


def end_what_is_forgotten(_event: Shutdown, context: LaunchContext) -> None:
    """
    Let the launch wait for every process that it has started, which makes it end them.

    When an action fails, such as one of a launch file that includes this one, launch forgets what
    the actions before it have started: it would end, and leave those processes behind.
    """
    for task in asyncio.all_tasks(context.asyncio_loop):
        if 'execute_process' in getattr(task.get_coro(), '__qualname__', ''):
            context.add_completion_future(task)


def generate_launch_description() -> LaunchDescription:
    """Describe the checks, and the handlers for what fails later."""
    return LaunchDescription(
        [
            OpaqueFunction(function=check),
            RegisterEventHandler(OnProcessExit(on_exit=end_if_failed)),
            RegisterEventHandler(OnShutdown(on_shutdown=end_what_is_forgotten)),
        ]
    )
