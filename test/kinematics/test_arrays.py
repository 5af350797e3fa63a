"""Records with arrays are short as text."""

from collections.abc import Iterator
import importlib
from inspect import isclass
from typing import Any

from klann_ros.calibration import CrankSamples
from klann_ros.dynamics import Dynamics, rods
from klann_ros.kinematics import foot_path, FourBar, KlannLeg, linkage_poses, tolerance_study
from klann_ros.kinematics.arrays import short_repr
import numpy as np
import pytest

FACES = ('kinematics', 'dynamics', 'gait', 'synthesis', 'calibration', 'datasheet')
LEG = KlannLeg()
BAR = FourBar(180, 80, 200, 150)
# Their fields have few numbers, or they are drawn and not printed.
OTHERS = {'NotConvergedError', 'Chart', 'ChartLine'}


def records() -> Iterator[Any]:
    """Yield the public classes with fields that are arrays."""
    for name in FACES:
        face = importlib.import_module(f'klann_ros.{name}')
        for public in face.__all__:
            record = getattr(face, public)
            annotations = str(getattr(record, '__annotations__', {}))
            if isclass(record) and ('ndarray' in annotations or 'Array' in annotations):
                yield record


def test_every_public_record_with_arrays_is_short() -> None:
    names = {record.__name__ for record in records() if record.__repr__ is not short_repr}
    assert names <= OTHERS
    assert len([*records()]) > 15


@pytest.mark.parametrize(
    'record',
    [
        foot_path(LEG),
        linkage_poses(LEG, np.zeros((40, 30)), points=True),
        tolerance_study(LEG, 0.001, samples=10),
        BAR.table(np.arange(1000.0)),
        Dynamics(LEG, rods(LEG, 1.0)).reactions(np.arange(1000.0)),
        Dynamics(LEG, rods(LEG, 1.0)).turn(1.0),
    ],
    ids=lambda record: type(record).__name__,
)
def test_the_text_of_a_record_is_one_short_line(record: Any) -> None:
    text = repr(record)
    assert text.startswith(f'{type(record).__name__}(')
    assert '\n' not in text
    assert len(text) < 700


def test_arrays_are_told_by_their_shape() -> None:
    samples = CrankSamples(np.zeros(3), np.zeros((3, 2), dtype=np.float32))
    assert repr(samples) == 'CrankSamples(times=float64[3], positions=float32[3, 2])'
