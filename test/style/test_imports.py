"""Only `klann_ros.nodes` imports ROS, imports go downward, and none goes in a circle."""

import ast
from collections.abc import Iterator
from functools import cache
from graphlib import CycleError, TopologicalSorter
from importlib import import_module
import os
from pathlib import Path
import subprocess
import sys

import pytest

PACKAGE = Path(__file__).resolve().parents[2] / 'klann_ros'

# What each part may import of the others. executables.py holds the entry points.
ALLOWED = {
    '__init__': set(),
    'lazy_face': set(),
    'sanitize': set(),
    'cli': {'lazy_face', 'sanitize'},
    'missing_package': set(),
    'engines': {'missing_package'},
    'kinematics': {'lazy_face', 'sanitize'},
    'synthesis': {'lazy_face', 'sanitize', 'kinematics'},
    'messages': {'lazy_face', 'sanitize'},
    'log': {'cli', 'lazy_face', 'messages', 'sanitize'},
    'dynamics': {'lazy_face', 'missing_package', 'sanitize', 'kinematics'},
    'robot': {'lazy_face', 'sanitize', 'kinematics', 'dynamics'},
    'gait': {'lazy_face', 'kinematics', 'dynamics', 'robot'},
    'walker': {'lazy_face', 'kinematics', 'dynamics', 'robot', 'gait'},
    'twin': {'lazy_face', 'missing_package', 'sanitize', 'kinematics', 'dynamics', 'robot'},
    'plotting': {'lazy_face', 'missing_package', 'kinematics'},
    'web': {'lazy_face', 'sanitize', 'kinematics'},
    'review': {
        *('cli', 'sanitize', 'engines', 'kinematics', 'dynamics', 'robot', 'plotting', 'log'),
        'web',
        *('calibration', 'lazy_face', 'messages', 'missing_package'),
    },
    'export': {
        *('cli', 'sanitize', 'kinematics', 'dynamics', 'plotting', 'robot', 'gait', 'walker'),
        *('missing_package', 'twin'),
    },
    'live': {
        *('engines', 'lazy_face', 'sanitize', 'kinematics', 'log', 'robot', 'export', 'review'),
        'web',
    },
    'datasheet': {
        *('cli', 'lazy_face', 'sanitize', 'kinematics', 'dynamics', 'robot', 'gait', 'web'),
        'export',
    },
    'calibration': {
        *('cli', 'lazy_face', 'sanitize', 'messages', 'kinematics', 'robot', 'log', 'web'),
        'datasheet',
    },
    'exercises': {
        *('cli', 'lazy_face', 'sanitize', 'kinematics', 'synthesis', 'plotting', 'web'),
    },
    'importing': {'cli', 'sanitize', 'kinematics', 'robot'},
    'design': {
        *('cli', 'sanitize', 'engines', 'kinematics', 'dynamics', 'robot', 'gait', 'web'),
        *('datasheet', 'export'),
    },
    'stop_signals': set(),
    'nodes': {
        *('cli', 'sanitize', 'kinematics', 'dynamics', 'robot', 'gait', 'walker', 'twin'),
        *('missing_package', 'plotting'),
        *('log', 'review', 'web', 'live', 'datasheet', 'stop_signals', 'messages'),
    },
    'executables': {
        *('missing_package', 'sanitize', 'kinematics', 'log', 'review', 'nodes', 'stop_signals'),
    },
}

# Modules of a package that others may import past its face.
PUBLIC_MODULES = {'angles', 'arrays', 'errors'}

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


def test_no_import_goes_in_a_circle() -> None:
    assert circle(PACKAGE) == []


def test_everything_but_the_nodes_imports_without_ros() -> None:
    assert needing_ros(PACKAGE) == []


def test_imports_go_downward() -> None:
    assert list(upward_imports(PACKAGE)) == []


def test_packages_import_each_other_by_their_faces() -> None:
    assert list(imports_past_a_face(PACKAGE)) == []


@pytest.mark.parametrize(
    'path', sorted(PACKAGE.glob('*/__init__.py')), ids=lambda path: path.parent.name
)
def test_a_face_offers_the_names_that_it_imports(path: Path) -> None:
    names = set()
    for node in ast.walk(ast.parse(path.read_text('utf-8'))):
        if isinstance(node, ast.ImportFrom) and node.level == 1:
            names |= {alias.name for alias in node.names}
    face = import_module(f'klann_ros.{path.parent.name}')
    assert {*getattr(face, '__all__', ())} == names
    assert [name for name in names if not hasattr(face, name)] == []


@pytest.mark.parametrize(
    ('line', 'count'),
    [
        ('from example.kinematics.linkage.file import shipped_linkage', 1),
        ('from example.kinematics.linkage import file', 1),
        ('from ..kinematics.linkage import file', 1),
        ('import example.kinematics.linkage', 1),
        ('from example.kinematics import Linkage', 0),
        ('from example.kinematics.angles import wrapped', 0),
        ('from .load import points', 0),
    ],
)
def test_an_import_past_a_face_is_counted(line: str, count: int, tmp_path: Path) -> None:
    package = make_package(tmp_path, 'review', line)
    assert len([*imports_past_a_face(package)]) == count


@pytest.mark.parametrize(
    'line',
    [
        'import rclpy',
        'from std_msgs.msg import Float64',
        'from rcl_interfaces.msg import ParameterDescriptor',
        'from std_srvs.srv import Trigger',
        'from ament_index_python import get_package_prefix',
        'from ..nodes import solver',
    ],
)
def test_a_module_that_needs_ros_is_found(line: str, tmp_path: Path) -> None:
    package = make_package(tmp_path, 'kinematics', line)
    (package / 'nodes' / 'solver.py').write_text('import rclpy')
    (problem,) = needing_ros(package)
    assert problem.startswith('example.kinematics.offender: ')


@pytest.mark.parametrize(
    ('part', 'line', 'count'),
    [
        ('kinematics', 'from ..log import reader', 1),
        ('kinematics', 'import example.review', 1),
        ('kinematics', 'def late():\n    from .. import nodes', 1),
        ('log', 'from example import kinematics', 1),
        ('review', 'from ..nodes import solver', 1),
        ('nodes', 'from ..executables import solver_node', 1),
        ('kinematics', 'from . import errors', 0),
        ('kinematics', 'import example_too.log', 0),
        ('log', 'from example import __version__', 0),
        ('review', 'from ..kinematics import KlannLeg\nfrom example.log import reader', 0),
    ],
)
def test_an_upward_import_is_found(part: str, line: str, count: int, tmp_path: Path) -> None:
    problems = [*upward_imports(make_package(tmp_path, part, line))]
    assert len(problems) == count
    assert all(text.startswith(f'{part}/offender.py imports ') for text in problems)


def test_an_unknown_part_is_found(tmp_path: Path) -> None:
    problems = [*upward_imports(make_package(tmp_path, 'utils', ''))]
    assert 'utils/offender.py belongs to no known part' in problems


@pytest.mark.parametrize(
    ('line', 'other', 'length'),
    [
        ('from .other import NAME', 'from .offender import NAME', 2),
        ('from . import other', 'import example.kinematics.offender', 2),
        ('from .other import NAME', 'def late():\n    from .offender import NAME', 2),
        ('from .other import NAME', 'from example.kinematics import NAME', 0),
        ('from .other import NAME', 'from . import errors', 0),
    ],
)
def test_a_circle_is_found(line: str, other: str, length: int, tmp_path: Path) -> None:
    package = make_package(tmp_path, 'kinematics', line)
    (package / 'kinematics' / 'other.py').write_text(other)
    assert len(circle(package)) == length


def test_a_circle_through_a_package_is_found(tmp_path: Path) -> None:
    package = make_package(tmp_path, 'log', 'from example.log import NAME')
    (package / 'log' / '__init__.py').write_text('from .third import NAME')
    (package / 'log' / 'third.py').write_text('from .offender import NAME')
    assert len(circle(package)) == 3


def make_package(folder: Path, part: str, line: str) -> Path:
    """Write a package with one module that may offend."""
    package = folder / 'example'
    for name in {'kinematics', 'log', 'review', 'nodes', part}:
        (package / name).mkdir(parents=True)
        (package / name / '__init__.py').touch()
    (package / '__init__.py').write_text('__version__ = "1"\n')
    (package / 'executables.py').touch()
    (package / part / 'offender.py').write_text(line)
    return package


def modules(package: Path) -> dict[str, Path]:
    """Return the files of a package by the full names of their modules."""
    files = {}
    for path in sorted(package.rglob('*.py')):
        files['.'.join(path.relative_to(package.parent).with_suffix('').parts)] = path
    return files


def needing_ros(package: Path) -> list[str]:
    """Return the errors of all modules but the nodes, imported without ROS."""
    names = [name.removesuffix('.__init__') for name in modules(package) if '.nodes.' not in name]
    environment = os.environ | {'PYTHONPATH': str(package.parent)}
    command = [sys.executable, '-c', WITHOUT_ROS, *names]
    return subprocess.check_output(command, env=environment, text=True).splitlines()


def upward_imports(package: Path) -> Iterator[str]:
    """Yield the imports of parts that a module's own part may not import."""
    parts = {name.split('.')[1] for name in modules(package)}
    for path in modules(package).values():
        relative = path.relative_to(package)
        part = relative.parts[0].removesuffix('.py')
        if part not in ALLOWED:
            yield f'{relative} belongs to no known part'
            continue
        imported_parts = set()
        for name in imported_names(package, path):
            if name.startswith(f'{package.name}.'):
                imported_parts.add(name.split('.')[1])
        for imported_part in sorted((imported_parts & parts) - ALLOWED[part] - {part}):
            yield f'{relative} imports {imported_part}'


def imports_past_a_face(package: Path) -> Iterator[str]:
    """Yield the imports of a module inside another package."""
    parts = {path.relative_to(package).parts[0] for path in package.glob('*/__init__.py')}
    for path in modules(package).values():
        relative = path.relative_to(package)
        for module, _ in imports(package, path):
            root, *names = module.split('.')
            is_deep = root == package.name and len(names) > 1 and names[-1] not in PUBLIC_MODULES
            if is_deep and names[0] in parts - {relative.parts[0], 'sanitize'}:
                yield f'{relative} imports {module}'


@cache
def imports(package: Path, path: Path) -> list[tuple[str, str]]:
    """Return the imports anywhere in a module: a module's full name, and a name in it or ''."""
    folder = [package.name, *path.relative_to(package).parts[:-1]]
    names = []
    for node in ast.walk(ast.parse(path.read_text('utf-8'))):
        if isinstance(node, ast.Import):
            names += [(alias.name, '') for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            base = folder[: len(folder) + 1 - node.level] if node.level else []
            module = '.'.join([*base, *filter(None, [node.module])])
            names += [(module, alias.name) for alias in node.names]
    return names


def imported_names(package: Path, path: Path) -> list[str]:
    """Return the full names of what a module imports: modules, or names in one."""
    return ['.'.join(filter(None, names)) for names in imports(package, path)]


def circle(package: Path) -> list[str]:
    """Return modules that import each other in a circle, for types too; [] without one."""
    files = modules(package)
    graph = {}
    for name, path in files.items():
        predecessors = set()
        for imported_name in imported_names(package, path):
            parent = imported_name.rpartition('.')[0]
            candidates = (imported_name, f'{imported_name}.__init__', parent, f'{parent}.__init__')
            predecessors.add(next((module for module in candidates if module in files), name))
        graph[name] = predecessors - {name}
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return list(error.args[1][1:])
    return []
