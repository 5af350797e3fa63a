"""
Public names of a package that are imported on first use, so that they cost no start time.

A package states them once, as imports for the type checker; they are read from its source, which
takes some 100 us::

    if TYPE_CHECKING:
        from .arguments import ArgumentParser, path
    else:
        __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
"""

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any


def lazy_face(
    package: str, file: str
) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """
    Return `__getattr__`, `__dir__` and `__all__` of a package (PEP 562).

    The block `if TYPE_CHECKING` of its source has nothing but imports from its modules.
    """
    modules = _modules_of_names(Path(file).read_text(encoding='utf-8'))

    def get_public_name(name: str) -> Any:
        if name not in modules:
            raise AttributeError(f'module {package!r} has no attribute {name!r}')
        return getattr(import_module(f'{package}.{modules[name]}'), name)

    def list_public_names() -> list[str]:
        return sorted(modules)

    return get_public_name, list_public_names, sorted(modules)


def _modules_of_names(source: str) -> dict[str, str]:
    _, _, block = source.partition('\nif TYPE_CHECKING:\n')
    block, _, _ = block.partition('\nelse:\n')
    modules = {}
    for statement in block.split('    from .')[1:]:
        module, _, names = statement.partition(' import ')
        for name in names.strip(' ()\n').split(','):
            if name.strip():
                modules[name.strip()] = module
    return modules
