"""ROS is known to `klann_ros.nodes` only, imports go downward, and none goes in a circle."""

import ast
from collections.abc import Collection, Iterable, Iterator, Mapping
import os
from pathlib import Path
import subprocess
import sys

import pytest

PACKAGE = Path(__file__).resolve().parents[2] / 'klann_ros'

# What each part may import of the others. executables.py holds the entry points.
ALLOWED = {
    '__init__': set(),
    'sanitize': set(),
    'engines': set(),
    'kinematics': {'sanitize'},
    'log': {'sanitize'},
    'dynamics': {'sanitize', 'kinematics'},
    'robot': {'sanitize', 'kinematics', 'dynamics'},
    'walker': {'kinematics', 'dynamics', 'robot'},
    'twin': {'sanitize', 'kinematics', 'dynamics', 'robot'},
    'sweeps': {'sanitize', 'engines', 'kinematics'},
    'plotting': {'kinematics'},
    'web': {'sanitize', 'kinematics'},
    'review': {'sanitize', 'engines', 'kinematics', 'dynamics', 'robot', 'plotting', 'log', 'web'},
    'export': {'sanitize', 'kinematics', 'dynamics', 'plotting', 'robot', 'twin'},
    'live': {'sanitize', 'kinematics', 'log', 'robot', 'review', 'web'},
    'datasheet': {'sanitize', 'kinematics', 'dynamics', 'robot', 'walker', 'web'},
    'stop_signals': set(),
    'nodes': {
        'sanitize',
        'kinematics',
        'dynamics',
        'robot',
        'walker',
        'twin',
        'plotting',
        'log',
        'review',
        'web',
        'live',
        'stop_signals',
    },
    'executables': {'sanitize', 'kinematics', 'log', 'review', 'nodes', 'stop_signals'},
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


def test_no_import_goes_in_a_circle() -> None:
    assert list(circles(PACKAGE)) == []


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
        'from ..nodes import solver',
    ],
)
def test_a_module_that_needs_ros_is_found(line: str, tmp_path: Path) -> None:
    package = made_up(tmp_path, 'kinematics', line)
    (package / 'nodes' / 'solver.py').write_text('import rclpy')
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
        ('review', 'from ..nodes import solver'),
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


@pytest.mark.parametrize(
    ('line', 'other'),
    [
        ('from .other import NAME', 'from .offender import NAME'),
        ('from . import other', 'from made_up.kinematics.offender import NAME'),
        ('import made_up.kinematics.other', 'def late():\n    from . import offender'),
        ('from .other import NAME', 'if TYPE_CHECKING:\n    from .offender import NAME'),
    ],
)
def test_a_circle_is_found(line: str, other: str, tmp_path: Path) -> None:
    package = made_up(tmp_path, 'kinematics', line)
    (package / 'kinematics' / 'other.py').write_text(other)
    names = ['made_up.kinematics.offender', 'made_up.kinematics.other']
    assert list(circles(package)) == [names]


def test_a_circle_by_way_of_a_face_is_found(tmp_path: Path) -> None:
    package = made_up(tmp_path, 'log', 'from made_up.log import NAME')
    (package / 'log' / '__init__.py').write_text('from .third import NAME')
    (package / 'log' / 'third.py').write_text('from .offender import NAME')
    assert [len(circle) for circle in circles(package)] == [3]


@pytest.mark.parametrize(
    'other', ['from . import errors', 'from made_up.log.offender import NAME']
)
def test_what_is_no_circle_is_not(other: str, tmp_path: Path) -> None:
    package = made_up(tmp_path, 'kinematics', 'from .other import NAME')
    (package / 'kinematics' / 'other.py').write_text(other)
    assert list(circles(package)) == []


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
    full_names = imported_names(package, path, ast.walk(ast.parse(path.read_text('utf-8'))))
    split = [name.split('.') for name in full_names]
    parts = {name[1] for name in split if name[0] == package.name and len(name) > 1}
    return {
        name for name in parts if (package / name).is_dir() or (package / f'{name}.py').exists()
    }


def imported_names(package: Path, path: Path, tree: Iterable[ast.AST]) -> Iterator[str]:
    """Yield the full names of what a module imports, whether they are modules or in one."""
    here = [package.name, *path.relative_to(package).parts[:-1]]
    for node in tree:
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            base = here[: len(here) + 1 - node.level] if node.level else []
            base = base + (node.module.split('.') if node.module else [])
            yield from ('.'.join([*base, alias.name]) for alias in node.names)


def circles(package: Path) -> Iterator[list[str]]:
    """Yield the groups of modules that import each other, directly or by way of others."""
    imports = imported_modules(package)
    reached = {name: reachable(imports, name) for name in imports}
    in_circles = [name for name in imports if name in reached[name]]
    while in_circles:
        first = in_circles[0]
        circle = [name for name in in_circles if name in reached[first] and first in reached[name]]
        yield circle
        in_circles = [name for name in in_circles if name not in circle]


def reachable(imports: Mapping[str, set[str]], start: str) -> set[str]:
    """Return the modules that one imports, those that these import, and so on."""
    reached: set[str] = set()
    due = [*imports[start]]
    while due:
        name = due.pop()
        if name not in reached:
            reached.add(name)
            due += imports[name]
    return reached


def imported_modules(package: Path) -> dict[str, set[str]]:
    """Return which modules of the package each module imports, anywhere in it, for types too."""
    paths = {
        '.'.join(path.relative_to(package.parent).with_suffix('').parts): path
        for path in sorted(package.rglob('*.py'))
    }
    imports = {}
    for name, path in paths.items():
        full_names = imported_names(package, path, ast.walk(ast.parse(path.read_text('utf-8'))))
        modules = (module_of(full_name, paths) for full_name in full_names)
        imports[name] = {module for module in modules if module and module != name}
    return imports


def module_of(full_name: str, modules: Collection[str]) -> str | None:
    """Return the module that a full name is, or that it is in; None for another package's."""
    around = full_name.rpartition('.')[0]
    candidates = (full_name, f'{full_name}.__init__', around, f'{around}.__init__')
    return next((name for name in candidates if name in modules), None)
