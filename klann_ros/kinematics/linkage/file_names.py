"""Names in a linkage's file that may be misspelt, and what they most likely should be."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from klann_ros.kinematics.errors import GeometryError
from klann_ros.untrusted.text import did_you_mean, listed

from .structure import Structure


def check_start(start: Mapping[str, float], bodies: Sequence[str]) -> None:
    """Refuse a start that has not an angle for every body, and for nothing else."""
    for name in start:
        if name not in bodies:
            hint = did_you_mean(name, bodies)
            msg = f'start has an angle for {name}, which is no body{hint}'
            raise GeometryError(msg)
    for name in bodies:
        if name not in start:
            msg = f'start has no angle for {name}: it needs one for every body'
            raise GeometryError(msg)


def misspelt(content: Mapping[str, Any], structure: Callable[..., Structure]) -> str:
    """
    Return in words which point of a file may be misspelt; empty for none.

    It is one that joins nothing, where another name would. `structure` makes a structure of a
    file's content and bodies.
    """
    points = {name: _points(body) for name, body in content['bodies'].items()}
    places = [content['foot'], *content['pivots'], *(p for own in points.values() for p in own)]
    alone = [(name, p) for name, own in points.items() for p in own if places.count(p) == 1]
    for name, point in alone:
        others = [other for other in dict.fromkeys(places) if other not in points[name]]
        fit = [other for other in others if _joins(content, name, {point: other}, structure)]
        # Above all one that nothing else leads to, such as a pivot.
        fit = [other for other in fit if places.count(other) == 1] or fit
        hint = did_you_mean(point, fit or others)
        if fit and not hint:
            hint = f'; did you mean {" or ".join(fit[:3])}?'
        if hint:
            return f'; the point {point} is in the body {name} alone{hint}'
    shown = listed((f'{point} of {name}' for name, point in alone), 5)
    return f'; in one body alone, and so joining nothing, are the points {shown}' if alone else ''


def _points(body: Mapping[str, Any]) -> list[str]:
    bars = every_bar(body)
    return list(dict.fromkeys(point for bar in bars for point in (bar['from'], bar['to'])))


def every_bar(body: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return the bars of a body in a file, the line that it slides along being the first."""
    line = [body['slides']] if 'slides' in body else []
    return [*line, *body.get('bars', ())]


def _joins(
    content: Mapping[str, Any],
    name: str,
    renamed: Mapping[str, str],
    structure: Callable[..., Structure],
) -> bool:
    """Return whether it is a linkage with a point of a body renamed."""
    body = content['bodies'][name]

    def other(bar: Mapping[str, Any]) -> dict[str, Any]:
        return {**bar, **{end: renamed.get(bar[end], bar[end]) for end in ('from', 'to')}}

    changed = {**body, 'bars': [other(bar) for bar in body.get('bars', ())]}
    if 'slides' in body:
        changed['slides'] = other(body['slides'])
    try:
        _ = structure(content, {**content['bodies'], name: changed}).groups
    except GeometryError:
        return False
    return True
