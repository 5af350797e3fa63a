"""The files that make up the package: what an installation depends on."""

from collections.abc import Iterator
import hashlib
from pathlib import Path
import shutil

ROOT = Path(__file__).resolve().parents[2]

# Whatever setup.py installs or reads. test/packaging compares the result with colcon's, which
# builds from the checkout itself, so a name that is missing here does not go unnoticed.
SHIPPED = (
    'CHANGELOG.rst',
    'LICENSE',
    'MANIFEST.in',
    'README.md',
    'config',
    'foxglove',
    'klann_ros',
    'launch',
    'package.xml',
    'pyproject.toml',
    'resource',
    'rviz',
    'scripts/launchers',
    'setup.cfg',
    'setup.py',
    'urdf',
)


def files(root: Path = ROOT) -> Iterator[Path]:
    """Yield the shipped files below `root`, always in the same order, as relative paths."""
    for name in SHIPPED:
        path = root / name
        for file in sorted(path.rglob('*')) if path.is_dir() else [path]:
            relative = file.relative_to(root)
            hidden = any(p.startswith('.') or p == '__pycache__' for p in relative.parts)
            if file.is_file() and not hidden:
                yield relative


def digest(root: Path = ROOT) -> str:
    """Return a hash of the shipped files: names, contents and whether they can be executed."""
    state = hashlib.sha256()
    for file in files(root):
        path = root / file
        content = hashlib.sha256(path.read_bytes()).hexdigest()
        state.update(f'{file}\0{path.stat().st_mode & 0o100}\0{content}\n'.encode())
    return state.hexdigest()


def copy(destination: Path) -> None:
    """
    Copy the shipped files, so that pip builds beside the checkout and not in it.

    pip builds where setup.py is. A `build/` left there by an earlier build would put modules that
    have been deleted since into the new wheel.
    """
    for file in files():
        target = destination / file
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / file, target)
