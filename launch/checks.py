"""
Checks that end a launch: before the start if something is missing, later if a node fails.

The other launch files include it first: it checks packages, files and arguments, and reports a
fault in one line. launch ignores the failure of a process; this file ends the launch.
"""

import asyncio
from collections.abc import Iterator
from importlib.util import find_spec
import os
from pathlib import Path

from ament_index_python.packages import get_package_prefix, PackageNotFoundError
from klann_ros.kinematics import linkage_from_file, LinkageFileError
from klann_ros.missing_package import install_command
from launch import LaunchContext, LaunchDescription
from launch.actions import OpaqueFunction, RegisterEventHandler
from launch.event_handlers import OnProcessExit, OnShutdown
from launch.events import Shutdown
from launch.events.process import ProcessExited
from launch.substitutions import SubstitutionFailure
from launch_ros.actions import Node
from launch_ros.substitutions import ExecutableInPackage

# What controller_manager loads, and what the hardware interface of topics is.
CONTROLLERS = ('joint_state_broadcaster', 'velocity_controllers')
HARDWARE = 'joint_state_topic_hardware_interface'


def programs(arguments: dict[str, str]) -> Iterator[tuple[str, str, str]]:
    """Yield the external programs to start: the reason, the package, the executable."""
    yield 'every launch', 'robot_state_publisher', 'robot_state_publisher'
    if 'sim' in arguments:  # an argument of ros2_control.launch.py alone
        if is_set(arguments, 'hardware'):
            yield 'ros2_control', 'controller_manager', 'ros2_control_node'
        else:
            yield 'hardware:=false', 'mujoco_ros2_control', 'ros2_control_node'
        yield 'ros2_control', 'controller_manager', 'spawner'
    if arguments.get('fuse') == 'ekf':
        yield 'fuse:=ekf', 'robot_localization', 'ekf_node'
    if is_set(arguments, 'rviz'):
        yield 'rviz:=true', 'rviz2', 'rviz2'
    if is_set(arguments, 'slider'):
        yield 'slider:=true', 'joint_state_publisher_gui', 'joint_state_publisher_gui'


def plugins(arguments: dict[str, str]) -> tuple[str, ...]:
    """Return the packages of others that are loaded, not started."""
    if 'sim' not in arguments:
        return ()
    return (*CONTROLLERS, HARDWARE) if is_set(arguments, 'hardware') else CONTROLLERS


def modules(arguments: dict[str, str]) -> dict[str, str]:
    """Return the optional Python modules of the nodes to start, and pip's extra of each."""
    needed = {}
    if is_set(arguments, 'view'):
        needed['aiohttp'] = 'view'
    # walk.launch.py simulates; ros2_control.launch.py may.
    if 'friction' in arguments or (is_set(arguments, 'hardware') and is_set(arguments, 'sim')):
        needed['mujoco'] = 'sim'
    return needed


def files(arguments: dict[str, str]) -> Iterator[str]:
    """Yield the arguments that name an input file."""
    if 'params_file' in arguments:  # absent where only the checks are launched
        yield 'params_file'
    if is_set(arguments, 'rviz'):
        yield 'rviz_config'


def is_set(arguments: dict[str, str], flag: str) -> bool:
    """Return whether a flag is set; False if this launch does not have it."""
    return arguments.get(flag, 'false').lower() == 'true'


def is_installed(package: str, executable: str, context: LaunchContext) -> bool:
    """Return whether launch_ros finds a program."""
    try:
        ExecutableInPackage(package=package, executable=executable).perform(context)
    except (PackageNotFoundError, SubstitutionFailure):
        return False
    return True


def require_package(package: str, user: str) -> None:
    """Refuse the launch if a package is not installed, with the command that installs it."""
    try:
        get_package_prefix(package)
    except PackageNotFoundError:
        raise RuntimeError(f'{user} needs {package}: {install_debian(package)}') from None


def install_debian(package: str) -> str:
    """Return the command that installs a package of ROS."""
    debian = f'ros-{os.environ.get("ROS_DISTRO", "jazzy")}-{package.replace("_", "-")}'
    return f'sudo apt install {debian}'


def check(context: LaunchContext) -> None:
    """Refuse invalid arguments and missing packages before the start."""
    arguments = context.launch_configurations
    for user, package, executable in programs(arguments):
        if not is_installed(package, executable, context):
            raise RuntimeError(f'{user} needs {package}: {install_debian(package)}')
    for package in plugins(arguments):
        require_package(package, 'ros2_control')
    for module, extra in modules(arguments).items():
        if find_spec(module) is None:
            raise RuntimeError(f'this launch needs {module}: {install_command(module, extra)}')
    for name in files(arguments):
        # A relative path starts in the user's folder.
        path = Path(arguments[name])
        if not path.is_file():
            reason = 'it is not a regular file' if path.exists() else 'there is no such file'
            raise RuntimeError(f'{name}:={path}: {reason}')
    if arguments.get('linkage'):
        try:
            linkage_from_file(arguments['linkage'])
        except LinkageFileError as error:
            raise RuntimeError(f'linkage:={error}') from None


# Programs of others without which a robot has no frames, no controllers or no pose.
NEEDED = ('robot_state_publisher', 'ros2_control_node', 'spawner', 'ekf_node')


def end_if_failed(event: ProcessExited, context: LaunchContext) -> None:
    """End the launch if a node that the robot needs has failed; RViz and the like may fail."""
    node = event.action
    if not isinstance(node, Node) or not event.returncode:
        return
    executable = node.node_executable
    if node.node_package != 'klann_ros' and executable not in NEEDED:
        return
    # During the shutdown only an unfinished run matters: a node that is interrupted while its
    # Python starts fails as well.
    if not context.is_shutdown or executable == 'recorder_node':
        name = node.node_name.lstrip('/')
        # Those of ros2_control have no name here.
        name = executable if 'unspecified' in name else name
        raise RuntimeError(f'{name} has failed, exit code {event.returncode}; the launch ends')


def wait_for_processes(_event: Shutdown, context: LaunchContext) -> None:
    """
    Let the launch wait for all its processes, so that it ends them.

    When an action fails, for example in an including launch file, launch forgets the processes of
    earlier actions: it would end and leave them running.
    """
    for task in asyncio.all_tasks(context.asyncio_loop):
        if 'execute_process' in getattr(task.get_coro(), '__qualname__', ''):
            context.add_completion_future(task)


def generate_launch_description() -> LaunchDescription:
    """Describe the checks, and the handlers of later failures."""
    return LaunchDescription(
        [
            OpaqueFunction(function=check),
            RegisterEventHandler(OnProcessExit(on_exit=end_if_failed)),
            RegisterEventHandler(OnShutdown(on_shutdown=wait_for_processes)),
        ]
    )
