"""package.xml and setup.py declare what the package imports, and block no binary release."""

import ast
from pathlib import Path
import re
import runpy
import subprocess
import sys
from typing import Any

from catkin_pkg.changelog import Changelog, populate_changelog_from_rst
from catkin_pkg.package import Package, parse_package
from environment import BUILD, LOCK, NEEDS
import klann_ros
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
import pytest
import setuptools

ROOT = Path(__file__).resolve().parents[2]
# The distribution and the rosdep key of a module; no key: an extra that package.xml leaves to pip.
MODULES = {
    'aiohttp': ('aiohttp', 'python3-aiohttp'),
    'argcomplete': ('argcomplete', 'python3-argcomplete'),
    'ezdxf': ('ezdxf', ''),
    'fontTools': ('fonttools', ''),
    'jsonschema': ('jsonschema', 'python3-jsonschema'),
    'lz4': ('lz4', 'mcap-ros2-support'),
    'manifold3d': ('manifold3d', ''),
    'matplotlib': ('matplotlib', 'python3-matplotlib'),
    'mcap': ('mcap', 'mcap-ros2-support'),
    'mujoco': ('mujoco', 'python3-mujoco-pip'),
    'numba': ('numba', ''),
    'numpy': ('numpy', 'python3-numpy'),
    'pandas': ('pandas', ''),
    'pyarrow': ('pyarrow', ''),
    'pymoo': ('pymoo', ''),
    'ray': ('ray', ''),
    'scipy': ('scipy', 'python3-scipy'),
    'tqdm': ('tqdm', 'python3-tqdm'),
    'trimesh': ('trimesh', ''),
    'yaml': ('PyYAML', 'python3-yaml'),
    'zstandard': ('zstandard', 'mcap-ros2-support'),
}
OF_ROS = re.compile(r'rclpy|ament_index_python|\w+_(msgs|srvs|interfaces)')
SHELL = {'HOME': '/home/user', 'ROS_VERSION': '2', 'ROS_DISTRO': 'jazzy'}
# A shell that wants what all programs and launch files need.
ALL = {**SHELL, 'KLANN_ROS_EXTRAS': 'all'}
# What bloom evaluates the conditions of REP 149 with.
BLOOM = {'ROS_VERSION': '2', 'ROS_DISTRO': 'jazzy', 'ROS_PYTHON_VERSION': '3'}


def imported() -> set[str]:
    """Return the modules of others that the package imports."""
    names: set[str] = set()
    for path in (ROOT / 'klann_ros').rglob('*.py'):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import):
                names |= {alias.name.partition('.')[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
                names.add(node.module.partition('.')[0])
    return names - sys.stdlib_module_names - {'klann_ros', 'typing_extensions'}


def requirement_lines(path: Path) -> list[str]:
    """Return the lines of a requirements file and of those that it includes."""
    lines = []
    for line in path.read_text(encoding='utf-8').splitlines():
        if line.startswith('-r '):
            lines += requirement_lines(path.parent / line.removeprefix('-r '))
        elif not line.startswith(('#', ' ')):
            lines.append(line.split(' #')[0].rstrip(' \\'))
    return list(filter(None, lines))


@pytest.fixture
def required_packages(monkeypatch: pytest.MonkeyPatch) -> list[Requirement]:
    """Return what scripts/test installs: requirements and extras of setup.py, and its file."""
    arguments: dict[str, Any] = {}
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr(setuptools, 'setup', arguments.update)
    runpy.run_path('setup.py')
    extras, file = NEEDS['test']
    lines = [*arguments['install_requires'], 'pip', BUILD, *requirement_lines(file)]
    for extra in (*extras.split(','), 'ros'):
        lines += arguments['extras_require'][extra]
    return list(map(Requirement, lines))


# Imports four programs, and a leg from a file; prints what modules of ours import from others.
FOUR_PROGRAMS = """
import builtins

original = builtins.__import__
imported = set()

def recording(name, names=None, places=None, imports=(), level=0):
    if not level and names and names.get('__name__', '').startswith('klann_ros.'):
        imported.add(name.partition('.')[0])
    return original(name, names, places, imports, level)

builtins.__import__ = recording
import klann_ros.nodes.solver.node, klann_ros.nodes.recorder.node, klann_ros.nodes.player.node
import klann_ros.review.command
from klann_ros.kinematics import shipped_linkage

shipped_linkage('jansen')
print(*imported)
"""


@pytest.fixture
def package() -> Package:
    return parse_package(str(ROOT / 'package.xml'))


def keys(package: Package, context: dict[str, str]) -> set[str]:
    """Return the rosdep keys that count where the conditions see these variables."""
    package.evaluate_conditions(context)
    depends = [*package.exec_depends, *package.test_depends, *package.doc_depends]
    return {depend.name for depend in depends if depend.evaluated_condition}


def test_imports_are_declared_to_pip_and_rosdep(package: Package) -> None:
    names = imported()
    of_ros = {name for name in names if OF_ROS.fullmatch(name)}
    assert names - of_ros <= {*MODULES}
    setup = (ROOT / 'setup.py').read_text()
    for module in names - of_ros:
        distribution, key = MODULES[module]
        assert re.search(rf"'{distribution}[\[>']", setup), module
        assert not key or key in keys(package, ALL), module
    assert of_ros <= keys(package, ALL)


def test_required_is_what_solver_recorder_player_and_review_import(package: Package) -> None:
    modules = subprocess.check_output([sys.executable, '-c', FOUR_PROGRAMS], text=True).split()
    others = {*modules} - sys.stdlib_module_names - {'klann_ros', ''}
    needed = {MODULES[module][1] if module in MODULES else module for module in others}
    package.evaluate_conditions(SHELL)
    assert {depend.name for depend in package.exec_depends if depend.evaluated_condition} == needed


def test_keys_that_rosdep_installs_by_pip_do_not_block_a_binary_release(package: Package) -> None:
    by_pip = {key for key in keys(package, SHELL) if key.endswith('-pip') or 'mcap' in key}
    assert by_pip >= {'mcap-ros2-support', 'python3-mujoco-pip'}
    assert keys(package, SHELL) - keys(package, BLOOM) == by_pip


def test_the_manifest_names_repository_bug_tracker_and_licences(package: Package) -> None:
    assert {url.type for url in package.urls} == {'repository', 'bugtracker'}
    assert package.licenses == ['Apache-2.0', 'MIT']
    assert package.licenses[0].file == 'LICENSE'


def test_versions_agree_and_the_changelog_is_catkins(package: Package) -> None:
    package.validate()
    assert package.version == klann_ros.__version__
    assert f"version='{package.version}'" in (ROOT / 'setup.py').read_text()
    # catkin_prepare_release gives the next version and a date to the section on top.
    changes = (ROOT / 'CHANGELOG.rst').read_text()
    next_release = '0.2.0 (2026-12-31)\n------------------'
    text = changes.replace('Forthcoming\n-----------', next_release, 1)
    changelog = populate_changelog_from_rst(Changelog(), text)
    sections = {version: entries for version, _, entries in changelog.foreach_version()}
    assert [*sections] == [package.version, '0.2.0']
    assert sections['0.2.0']
    assert len(sections[package.version]) > 10


def test_the_launchers_are_the_entry_points() -> None:
    named = re.findall(
        r"^                '(\w+)',$", (ROOT / 'setup.py').read_text(), re.MULTILINE
    )
    launchers = list((ROOT / 'scripts' / 'launchers').iterdir())
    assert sorted(path.name for path in launchers) == sorted(named)
    assert all(path.stat().st_mode & 0o111 for path in launchers)


@pytest.mark.parametrize('minor', range(10, 15))
def test_the_lock_of_ci_has_one_version_of_each_requirement_for_each_python(
    minor: int, required_packages: list[Requirement]
) -> None:
    python = {'python_version': f'3.{minor}', 'python_full_version': f'3.{minor}.20'}
    locked: dict[str, list[str]] = {}
    for pin in map(Requirement, requirement_lines(LOCK)):
        if pin.marker is None or pin.marker.evaluate(python):
            locked.setdefault(canonicalize_name(pin.name), []).append(str(pin.specifier)[2:])
    assert {name: pins for name, pins in locked.items() if len(pins) > 1} == {}
    for requirement in required_packages:
        pins = locked.get(canonicalize_name(requirement.name), [])
        assert len([*requirement.specifier.filter(pins)]) == 1, f'{requirement}: scripts/lock'
