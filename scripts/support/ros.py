"""Which ROS 2 there is, and the variables under which an environment's Python finds it."""

from dataclasses import dataclass
import json
import os
from pathlib import Path
import subprocess
import sys

DISTRO = 'jazzy'
GUARD = '_ROS_WHEELS_BOOTSTRAP_COMPLETE'
PROBE = 'import json, numpy, rclpy; print(json.dumps([rclpy.__file__, numpy.__version__]))'
# pip options that would send an installation elsewhere, and Python options of somebody's shell.
FOREIGN = ('PIP_USER', 'PIP_TARGET', 'PIP_PREFIX', 'PIP_CONSTRAINT', 'PYTHONHOME')
PATHS = ('PYTHONPATH', 'AMENT_PREFIX_PATH', 'LD_LIBRARY_PATH')


@dataclass(frozen=True)
class SourcedRos:
    """A ROS 2 Jazzy that the caller's shell has sourced and this Python can import."""

    rclpy: str
    numpy: str


def sourced(python: Path) -> SourcedRos | None:
    """Return the sourced ROS 2 Jazzy, or None if there is none for this Python."""
    distro = os.environ.get('ROS_DISTRO')
    if distro is None:
        return None
    if distro != DISTRO:
        print(f'ROS 2 {distro} is sourced; klann_ros needs {DISTRO} and takes its wheels instead.')
        return None
    answer = subprocess.run(
        [python, '-c', PROBE], env=clean_variables(), capture_output=True, check=False, text=True
    )
    if answer.returncode:
        version = '.'.join(map(str, sys.version_info[:2]))
        reason = (answer.stderr.strip().splitlines() or ['no reason given'])[-1]
        print(f'Python {version} cannot import the sourced ROS 2, wheels instead of it: {reason}')
        return None
    return SourcedRos(*json.loads(answer.stdout))


def clean_variables() -> dict[str, str]:
    """Return our variables without what another environment or klann_ros left there."""
    variables = {key: value for key, value in os.environ.items() if key not in (*FOREIGN, GUARD)}
    # ~/.local must not put a NumPy of its own over the one that ROS was built for.
    variables['PYTHONNOUSERSITE'] = '1'
    for name in PATHS:
        kept = [entry for entry in variables.pop(name, '').split(os.pathsep) if entry]
        if name == 'LD_LIBRARY_PATH':
            kept = without_wheels(kept)
        else:
            kept = [entry for entry in kept if not _holds_klann_ros(Path(entry))]
        if kept:
            variables[name] = os.pathsep.join(kept)
    return variables


def without_wheels(entries: list[str]) -> list[str]:
    """
    Drop the library folders that the wheels' bootstrapper added for another environment.

    It starts Python once more with PREFIX/lib and PREFIX/lib/pythonX.Y/site-packages/ros_*.libs.
    """
    libs = [Path(entry) for entry in entries]
    wheels = [lib for lib in libs if lib.name.startswith('ros_') and lib.suffix == '.libs']
    prefixes = {wheel.parents[2] for wheel in wheels if len(wheel.parents) > 2}
    return [str(lib) for lib in libs if lib not in wheels and lib not in prefixes]


def children_variables(folder: Path, ros: SourcedRos | None) -> dict[str, str]:
    """Return the variables for the programs of the environment in `folder`."""
    variables = clean_variables()
    if ros is None:
        # Nothing of a ROS that was sourced for another Python, and the wheels' only middleware.
        for name in (*PATHS, 'COLCON_PREFIX_PATH', 'RMW_IMPLEMENTATION', 'ROS_DISTRO'):
            variables.pop(name, None)
    prefixes = [str(folder), variables.get('AMENT_PREFIX_PATH', '')]
    variables['AMENT_PREFIX_PATH'] = os.pathsep.join(filter(None, prefixes))
    variables['PATH'] = os.pathsep.join([str(folder / 'bin'), variables.get('PATH', os.defpath)])
    variables['VIRTUAL_ENV'] = str(folder)
    return variables


def _holds_klann_ros(entry: Path) -> bool:
    # A colcon workspace with this package in it comes before the environment's own copy.
    return (entry / 'klann_ros').is_dir() or (entry / 'share' / 'klann_ros').is_dir()
