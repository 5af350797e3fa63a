"""An invalid argument is refused with its name and the reason, and changes nothing."""

import builtins
from functools import partial
from itertools import product
from pathlib import Path
import re
from typing import Any

from four_bars import COURSE
from klann_ros import kinematics
from klann_ros.kinematics import FourBar, KlannGeometry, KlannLeg
from klann_ros.kinematics.svg import animation_svg
import numpy as np
import pytest
from yaml_tables import read_table

KLANN = KlannLeg()
BAR = FourBar(*COURSE)
SUBJECTS: dict[str, Any] = {
    'klann': KLANN,
    'bar': BAR,
    'bar_with': partial(FourBar, *COURSE),
    'geometry': BAR.geometry,
    'sem104': KlannGeometry(),
    'patent': KlannGeometry.patent(),
    'linkage': KLANN.linkage,
    'pose': KLANN.solve(1.0),
    'bar_pose': BAR.solve(1.0),
    'path': kinematics.foot_path(KlannLeg()),
    'animation_svg': animation_svg,
    'huge': 10**400,
    'bytes': b'1',
    'imaginary': 1j,
    'array': np.array([1.0, 2.0]),
    'set': {1, -1},
}


def substituted(argument: Any, refused: object = None) -> Any:
    """Return an argument of the table: `_` is the refused one, and $names are subjects."""
    if argument == '_':
        return refused
    if isinstance(argument, str) and argument.startswith('$'):
        return subject(argument)
    if isinstance(argument, list):
        return [substituted(element, refused) for element in argument]
    return argument


def subject(name: str) -> Any:
    name = name.removeprefix('$')
    return SUBJECTS[name] if name in SUBJECTS else getattr(kinematics, name)


def refused_calls() -> list[Any]:
    cases = []
    for error, rows in read_table(Path(__file__).with_name('refusals.yaml')).items():
        error_type = getattr(kinematics, error, None) or getattr(builtins, error)
        for calls, arguments, refusals, reason in rows:
            for call, refused in product(calls if isinstance(calls, list) else [calls], refusals):
                label = f'{call} {refused}'[:60]
                cases.append(pytest.param(call, arguments, refused, error_type, reason, id=label))
    return cases


@pytest.mark.parametrize(('call', 'arguments', 'refused', 'error', 'reason'), refused_calls())
def test_an_invalid_argument_is_refused(
    call: str, arguments: list[Any], refused: object, error: type[Exception], reason: str
) -> None:
    name, _, method = call.partition('.')
    function = getattr(subject(name), method) if method else subject(name)
    argument = substituted(refused)
    positional = list(arguments)
    keywords = positional.pop() if isinstance(positional[-1], dict) else {}
    keywords = {key: substituted(template, argument) for key, template in keywords.items()}
    last_poses = [KLANN.last, BAR.last]
    with pytest.raises(error, match=reason.replace('%r', re.escape(repr(argument)))) as caught:
        function(*substituted(positional, argument), **keywords)
    assert caught.type is error
    if error is kinematics.CrankAngleError:
        assert caught.value.alpha is argument
    assert [KLANN.last, BAR.last] == last_poses
