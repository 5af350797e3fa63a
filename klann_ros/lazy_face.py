"""Public names of a package that are imported on first use, so that they cost no start time."""

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def lazy_face(
    package: str, names_of_modules: Mapping[str, str]
) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """
    Return `__getattr__`, `__dir__` and `__all__` of a package (PEP 562).

    Parameters
    ----------
    package : str
        Name of the package.
    names_of_modules : mapping of str to str
        Public names, separated by blanks, of each module of the package.

    """
    modules = {
        name: module for module, names in names_of_modules.items() for name in names.split()
    }

    def get_public_name(name: str) -> Any:
        if name not in modules:
            raise AttributeError(f'module {package!r} has no attribute {name!r}')
        return getattr(import_module(f'{package}.{modules[name]}'), name)

    def list_public_names() -> list[str]:
        return sorted(modules)

    return get_public_name, list_public_names, sorted(modules)
