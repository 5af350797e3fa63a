"""The command that installs a package which a program needs, and which is not there."""

import os
import sys

# Distributions on PyPI with another name than their module.
DISTRIBUTIONS = {'fontTools': 'fonttools', 'yaml': 'PyYAML'}
# Modules that Ubuntu 24.04 has no package of.
_ONLY_ON_PYPI = ('manifold3d', 'mcap', 'mujoco', 'pyarrow', 'pymoo', 'ray', 'rosbags', 'trimesh')


def install_command(module: str, extra: str = '') -> str:
    """
    Return the command that installs the package of a module.

    It is rosdep's where ROS 2 is sourced outside of a virtual environment, else pip's, with the
    extra of this package that has the module.
    """
    distro = os.environ.get('ROS_DISTRO')
    is_virtual = sys.prefix != sys.base_prefix
    if module.startswith('rcl') or module.endswith(('_msgs', '_srvs', '_interfaces')):
        if distro:
            return f'sudo apt install ros-{distro}-{module.replace("_", "-")}'
        return "source ROS 2 (/opt/ros/jazzy/setup.bash), or pip install 'klann_ros[ros]'"
    distribution = DISTRIBUTIONS.get(module, module)
    if not distro or is_virtual:
        return f"pip install 'klann_ros[{extra}]'" if extra else f'pip install {distribution}'
    if module in _ONLY_ON_PYPI:
        # Ubuntu's pip refuses to install beside the system's packages (PEP 668).
        return f'pip install --break-system-packages {distribution}'
    return f'sudo apt install python3-{module.lower()}'
