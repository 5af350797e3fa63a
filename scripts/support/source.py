"""The files of the package, on which an installation depends."""

from collections.abc import Iterator
import hashlib
from pathlib import Path
import shutil

ROOT = Path(__file__).resolve().parents[2]

# Whatever setup.py installs or reads. test/packaging compares the result with colcon's, which
# builds from the checkout itself, so a missing name is detected.
FOLDERS = (
    'config',
    'examples/requirements',
    'foxglove',
    'klann_ros',
    'launch',
    'plotjuggler',
    'resource',
    'rviz',
    'urdf',
)
FILES = ('LICENSE', '*.cfg', '*.md', '*.py', '*.rst', '*.toml', '*.xml', 'scripts/launchers/*')


def files(root: Path = ROOT) -> Iterator[Path]:
    """Yield the shipped files below `root`, always in the same order, as relative paths."""
    for pattern in (*FILES, *(f'{folder}/**/*' for folder in FOLDERS)):
        for path in sorted(root.glob(pattern)):
            relative = path.relative_to(root)
            if path.is_file() and not any(p.startswith(('.', '__pyc')) for p in relative.parts):
                yield relative


def digest(root: Path = ROOT) -> str:
    """Return a hash of the shipped files: names, contents and whether they can be executed."""
    state = hashlib.sha256()
    for file in files(root):
        content = (root / file).read_bytes()
        state.update(f'{file}\0{(root / file).stat().st_mode & 0o100}\0{len(content)}\0'.encode())
        state.update(content)
    return state.hexdigest()


def copy(destination: Path) -> None:
    """Copy the shipped files: pip builds where setup.py is, and must find no older build."""
    for file in files():
        (destination / file).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / file, destination / file)
