"""What a model is written with: names, places, numbers, and what touches what."""

from klann_ros.sanitize.text import printable

# Between the names of a leg and of its joint: ros2_control and MoveIt refuse a slash.
SEPARATOR = '_'


class Names:
    """Names of which none is given twice to one kind of element, and none breaks the XML."""

    def __init__(self) -> None:
        self._taken = {('body', 'world')}

    def __call__(self, kind: str, wanted: str) -> str:
        """Return a name: the wanted one, or it with as many `_` as it takes."""
        name = printable(wanted)
        while (kind, name) in self._taken:
            name += '_'
        self._taken.add((kind, name))
        return name


def touching(friction: float, *, floor: bool = False) -> dict[str, str]:
    """Return the attributes of what touches the floor, or of the floor, and nothing else."""
    own, other = ('1', '2') if floor else ('2', '1')
    # Stiff contact: in a soft one the feet sink and creep, which shortens a walk.
    return {
        'contype': own,
        'conaffinity': other,
        'friction': f'{number(friction)} 0.005 0.0001',
        'solref': '0.003 1',
    }


def at(place: complex) -> str:
    """Return a place, or a direction, in a leg's plane."""
    return f'{number(place.real)} {number(place.imag)} 0'


def number(value: float) -> str:
    """Return a number to the last digit."""
    return repr(float(value) + 0.0).removesuffix('.0')
