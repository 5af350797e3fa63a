"""The command that installs a missing package, as this machine installs packages."""

import sys

from klann_ros import executables
from klann_ros.missing_package import install_command
import pytest

VENV = 'venv'
SYSTEM = 'system'
SOURCED = {'ROS_DISTRO': 'jazzy'}


@pytest.mark.parametrize(
    ('python', 'variables', 'package', 'command'),
    [
        (VENV, {}, ('matplotlib', 'plot'), "pip install 'klann_ros[plot]'"),
        (VENV, {}, ('yaml', ''), 'pip install PyYAML'),
        (VENV, SOURCED, ('matplotlib', 'plot'), "pip install 'klann_ros[plot]'"),
        (SYSTEM, SOURCED, ('matplotlib', 'plot'), 'sudo apt install python3-matplotlib'),
        (SYSTEM, SOURCED, ('yaml', ''), 'sudo apt install python3-yaml'),
        (SYSTEM, SOURCED, ('fontTools', 'design'), 'sudo apt install python3-fonttools'),
        (SYSTEM, SOURCED, ('mujoco', 'sim'), 'pip install --break-system-packages mujoco'),
        (VENV, SOURCED, ('nav_msgs', 'ros'), 'sudo apt install ros-jazzy-nav-msgs'),
        (
            *(VENV, {}, ('rclpy', 'ros')),
            "source ROS 2 (/opt/ros/jazzy/setup.bash), or pip install 'klann_ros[ros]'",
        ),
    ],
)
def test_it_is_apts_where_ros_is_sourced_and_pips_elsewhere(
    python: str,
    variables: dict[str, str],
    package: tuple[str, str],
    command: str,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(sys, 'prefix', sys.base_prefix if python == SYSTEM else '/venv')
    monkeypatch.delenv('ROS_DISTRO', raising=False)
    for name, setting in variables.items():
        monkeypatch.setenv(name, setting)
    assert install_command(*package) == command


@pytest.mark.parametrize(
    ('program', 'module', 'extra'),
    [('design', 'scipy.optimize', 'design'), ('export', 'ezdxf', 'dxf')],
)
def test_a_program_names_the_extra_with_the_package_that_is_missing(
    program: str,
    module: str,
    extra: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.delenv('ROS_DISTRO', raising=False)
    executables._report_missing(program, ModuleNotFoundError(name=module))
    missing = f'there is no Python module {module.partition(".")[0]} here'
    assert capsys.readouterr().err == f"{program}: {missing}: pip install 'klann_ros[{extra}]'\n"
    # Its own modules are never missing: that is a fault with a traceback.
    with pytest.raises(ModuleNotFoundError):
        executables._report_missing(program, ModuleNotFoundError(name='klann_ros.nothing'))
