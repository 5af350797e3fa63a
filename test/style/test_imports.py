"""ROS is known to `klann_ros.nodes` only, and imports go downward."""

import ast
from collections.abc import Iterator
import os
from pathlib import Path
import subprocess
import sys

import pytest

PACKAGE = Path(__file__).resolve().parents[2] / 'klann_ros'

# What each part may import of the others. executables.py holds the entry points.
ALLOWED = {
    '__init__': set(),
    'untrusted': set(),
    'kinematics': {'untrusted'},
    'log': {'untrusted'},
    'plotting': {'kinematics'},
    'review': {'untrusted', 'kinematics', 'plotting', 'log'},
    'stop_signals': set(),
    'nodes': {'untrusted', 'kinematics', 'plotting', 'log', 'review', 'stop_signals'},
    'executables': {'untrusted', 'kinematics', 'log', 'review', 'nodes', 'stop_signals'},
}

# Imports each module named on the command line, in a Python that has no ROS.
WITHOUT_ROS = """
import importlib, re, sys

ROS = re.compile(r'rclpy|rcl_interfaces|\\w+_(msgs|interfaces|srvs)|ament_|rosidl|launch')

class Blocker:
    def find_spec(self, name, path=None, target=None):
        if ROS.match(name):
            raise ImportError(f'{name} is ROS')

sys.meta_path.insert(0, Blocker())
for name in sys.argv[1:]:
    try:
        importlib.import_module(name)
    except Exception as error:
        print(f'{name}: {error}')
"""


def test_everything_but_the_nodes_imports_without_ros() -> None:
    assert list(needing_ros(PACKAGE)) == []


def test_imports_go_downward() -> None:
    assert list(upward_imports(PACKAGE)) == []


@pytest.mark.parametrize(
    'line',
    [
        'import rclpy',
        'from std_msgs.msg import Float64',
        'from rcl_interfaces.msg import ParameterDescriptor',
        'from builtin_interfaces.msg import Time',
        'from std_srvs.srv import Trigger',
        'from ament_index_python import get_package_prefix',
        'from ..nodes import solver_node',
    ],
)
def test_a_module_that_needs_ros_is_found(line: str, tmp_path: Path) -> None:
    package = made_up(tmp_path, 'kinematics', line)
    (package / 'nodes' / 'solver_node.py').write_text('import rclpy')
    (problem,) = needing_ros(package)
    assert problem.startswith('made_up.kinematics.offender: ')


def test_nodes_may_need_ros(tmp_path: Path) -> None:
    assert list(needing_ros(made_up(tmp_path, 'nodes', 'import rclpy'))) == []


@pytest.mark.parametrize(
    ('part', 'line'),
    [
        ('kinematics', 'from ..log import reader'),
        ('kinematics', 'from made_up.log import reader'),
        ('kinematics', 'import made_up.review'),
        ('kinematics', 'def late():\n    from .. import nodes'),
        ('log', 'from made_up import kinematics'),
        ('log', 'from .. import kinematics'),
        ('review', 'from ..nodes import solver_node'),
        ('nodes', 'from ..executables import solver_node'),
        ('nodes', 'from made_up import executables'),
    ],
)
def test_an_upward_import_is_found(part: str, line: str, tmp_path: Path) -> None:
    (problem,) = upward_imports(made_up(tmp_path, part, line))
    assert problem.startswith(f'{part}/offender.py imports ')


@pytest.mark.parametrize(
    ('part', 'line'),
    [
        ('kinematics', 'from . import errors'),
        ('kinematics', 'import made_up_too.log'),
        ('log', 'from made_up import __version__'),
        ('review', 'from ..kinematics import KlannLeg\nfrom made_up.log import reader'),
        ('nodes', 'from ..review import figures'),
    ],
)
def test_other_imports_are_not(part: str, line: str, tmp_path: Path) -> None:
    assert list(upward_imports(made_up(tmp_path, part, line))) == []


def test_a_part_that_nobody_has_placed_is_found(tmp_path: Path) -> None:
    problems = list(upward_imports(made_up(tmp_path, 'utils', '')))
    assert 'utils/offender.py belongs to no known part' in problems


def made_up(folder: Path, part: str, line: str) -> Path:
    """Make a package with one module that may offend."""
    package = folder / 'made_up'
    for name in {'kinematics', 'log', 'review', 'nodes', part}:
        (package / name).mkdir(parents=True)
        (package / name / '__init__.py').touch()
    (package / '__init__.py').write_text('__version__ = "1"\n')
    (package / 'executables.py').touch()
    (package / part / 'offender.py').write_text(line)
    return package


def needing_ros(package: Path) -> Iterator[str]:
    """Yield what goes wrong when everything but the nodes is imported without ROS."""
    names = [
        '.'.join([package.name, *path.relative_to(package).with_suffix('').parts])
        for path in sorted(package.rglob('*.py'))
        if path.relative_to(package).parts[0] != 'nodes'
    ]
    names = [name.removesuffix('.__init__') for name in names]
    result = subprocess.run(
        [sys.executable, '-c', WITHOUT_ROS, *names],
        env=os.environ | {'PYTHONPATH': str(package.parent)},
        capture_output=True,
        check=True,
        text=True,
    )
    yield from result.stdout.splitlines()


def upward_imports(package: Path) -> Iterator[str]:
    """Yield the imports of parts that a module's own part may not know."""
    for path in sorted(package.rglob('*.py')):
        relative = path.relative_to(package)
        part = relative.parts[0].removesuffix('.py')
        if part not in ALLOWED:
            yield f'{relative} belongs to no known part'
            continue
        for other in sorted(imported_parts(package, path) - ALLOWED[part] - {part}):
            yield f'{relative} imports {other}'


def imported_parts(package: Path, path: Path) -> set[str]:
    """Return the parts of the package that a module imports, anywhere in it."""
    full_names = []
    here = [package.name, *path.relative_to(package).parts[:-1]]
    for node in ast.walk(ast.parse(path.read_text(encoding='utf-8'))):
        if isinstance(node, ast.Import):
            full_names += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = here[: len(here) + 1 - node.level] if node.level else []
            base = base + (node.module.split('.') if node.module else [])
            full_names += ['.'.join([*base, alias.name]) for alias in node.names]
    split = [name.split('.') for name in full_names]
    found = {name[1] for name in split if name[0] == package.name and len(name) > 1}
    return {
        name for name in found if (package / name).is_dir() or (package / f'{name}.py').exists()
    }
