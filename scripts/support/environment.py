"""The environment of the commands: a folder `.venv-X.Y` in the checkout, made when needed."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
import hashlib
from importlib.util import find_spec
import json
import os
from pathlib import Path
import sys

from command_error import CommandError
from lock import made_folder
import ros
import source

STAMP = 'klann_ros.json'
# What each command needs: extras of setup.py, and more requirements in a file.
EXTRAS = {'demo': ('plot',), 'test': ('fast', 'plot', 'test'), 'benchmark': ('fast', 'plot')}
REQUIREMENTS = {
    'test': source.ROOT / 'scripts' / 'support' / 'checks.txt',
    'benchmark': source.ROOT / 'scripts' / 'support' / 'benchmarks.txt',
}


@dataclass(frozen=True)
class Environment:
    """Where an environment is and what it is made of."""

    folder: Path
    base_python: Path
    sourced: ros.SourcedRos | None
    constraints: str

    @property
    def python(self) -> Path:
        """Return the interpreter."""
        return self.folder / 'bin' / 'python'

    @property
    def variables(self) -> dict[str, str]:
        """Return the variables for its programs."""
        return ros.children_variables(self.folder, self.sourced)

    @property
    def identity(self) -> list[str]:
        """Return what cannot change without making it anew; a moved checkout is such a change."""
        return [str(self.folder), str(self.base_python), str(self.sourced), self.constraints]

    def tool(self, name: str) -> list[str | Path]:
        """
        Return how to start a Python tool, also one that a sourced ROS's Python brought.

        -P: the checkout is the working folder, but the installed klann_ros is what counts.
        """
        script = self.folder / 'bin' / name
        return [script] if script.exists() else [self.python, '-P', '-m', name]

    def extras(self, command: str) -> list[str]:
        """Return the extras of setup.py that a command needs here."""
        return [*EXTRAS[command], *([] if self.sourced else ['ros'])]

    def requirements(self, command: str) -> str:
        """Return a hash of everything that decides which packages a command needs."""
        parts = [*self.extras(command), (source.ROOT / 'setup.py').read_text(encoding='utf-8')]
        if command in REQUIREMENTS:
            parts.append(REQUIREMENTS[command].read_text(encoding='utf-8'))
        return hashlib.sha256('\0'.join(parts).encode()).hexdigest()

    def stamp(self) -> dict[str, object]:
        """Return what was written when it was last finished; empty if it never was."""
        try:
            stamp = json.loads((self.folder / STAMP).read_text(encoding='utf-8'))
        except (OSError, ValueError):
            return {}
        # The interpreter it was made with may be gone.
        whole = stamp.get('identity') == self.identity and self.python.exists()
        return stamp if whole else {}

    def is_ready(self, command: str) -> bool:
        """Tell whether everything a command needs is there, built from the present files."""
        stamp = self.stamp()
        return (
            stamp.get(command) == self.requirements(command)
            and stamp.get('source') == source.digest()
        )


def choose() -> Environment:
    """Return the environment that belongs to this Python, this shell and PIP_CONSTRAINT."""
    base = Path(sys.executable).resolve()
    version = '.'.join(map(str, sys.version_info[:2]))
    if find_spec('venv') is None or find_spec('ensurepip') is None:
        raise CommandError(
            f'{base} cannot make environments: apt install python3-venv (or python{version}-venv)'
        )
    sourced = ros.sourced(base)
    constraints = _constraints()
    name = f'.venv-{version}'
    if sourced:
        name += '-ros'
    if constraints:
        name += '-' + hashlib.sha256(constraints.encode()).hexdigest()[:6]
    return Environment(source.ROOT / name, base, sourced, constraints)


@contextmanager
def environment(command: str) -> Iterator[Environment]:
    """Make what `command` needs, unless it is there already, and keep it as it is while in use."""
    chosen = choose()

    def make() -> None:
        # Not needed when everything is there, and then not loaded either.
        from install import install  # noqa: PLC0415

        install(chosen, command)

    with made_folder(chosen.folder, lambda: chosen.is_ready(command), make):
        yield chosen


def _constraints() -> str:
    """Return the text of the files that PIP_CONSTRAINT names, one after the other."""
    names = os.environ.get('PIP_CONSTRAINT', '').split()
    try:
        return '\n'.join(Path(name).read_text(encoding='utf-8') for name in names)
    except OSError as error:
        raise CommandError(f'PIP_CONSTRAINT: {error.filename}: {error.strerror}') from error
