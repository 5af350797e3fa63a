"""The launch files as syntax, which can be read without the launch package."""

import ast
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FILES = {path.name: path for path in sorted((ROOT / 'launch').glob('*.py'))}


def nodes(name: str, kind: type) -> Iterator:
    for node in ast.walk(ast.parse(FILES[name].read_text())):
        if isinstance(node, kind):
            yield node


def calls(name: str, *functions: str) -> Iterator[ast.Call]:
    for call in nodes(name, ast.Call):
        if getattr(call.func, 'id', '') in functions:
            yield call


def constants(parts: list[ast.expr]) -> list[object]:
    return [part.value for part in parts if isinstance(part, ast.Constant)]


def keywords(call: ast.Call) -> dict[str, object]:
    return {
        word.arg: word.value.value
        for word in call.keywords
        if isinstance(word.value, ast.Constant) and word.arg
    }


def declared(name: str) -> dict[str, object]:
    """Return the arguments of a launch file with their descriptions."""
    return {
        constants(call.args)[0]: keywords(call).get('description')
        for call in calls(name, 'DeclareLaunchArgument')
    }


def included(name: str) -> set[str]:
    return {
        str(word)
        for call in calls(name, 'PathJoinSubstitution', 'included')
        for word in constants(getattr(call.args[0], 'elts', call.args))
        if str(word).endswith('.py')
    }
