"""A linkage's joints as `export --joints` writes them, read back."""

from cmath import phase
from pathlib import Path

from klann_ros.export.command import main as export
from klann_ros.importing.command import main as import_linkage
from klann_ros.kinematics import linkage_from_file, LinkageLeg, shipped_linkage
import pytest

# Lines on the ground and on links, coupled loops, change points, a clockwise crank's link, feet.
NAMES = ('quick_return', 'scotch_yoke', 'stephenson', 'parallelogram', 'klann', 'trotbot')


@pytest.mark.parametrize('name', NAMES)
def test_exported_joints_are_read_back(name: str, tmp_path: Path) -> None:
    table = tmp_path / 'joints.csv'
    output = tmp_path / 'linkage.yaml'
    assert export([name, '--joints', str(table)]) == 0
    assert import_linkage([str(table), '-o', str(output)]) == 0
    leg = LinkageLeg(shipped_linkage(name))
    copy = LinkageLeg(linkage_from_file(output))
    assert copy.linkage.structure.foot == leg.linkage.structure.foot
    # Both cranks have their pivot and another point in common, which need not be the second one.
    start, end = leg.reachable_arcs()[0]
    angles = [start + part * (end - start) for part in (0.1, 0.37, 0.6, 0.9)]
    sense = leg.linkage.structure.senses[0]
    first = leg.solve(angles[1])
    points = dict(zip(leg.linkage.structure.points, first.points, strict=True))
    pivot, pin = copy.linkage.structure.crank.points[:2]
    direction = phase(complex(*(points[pin] - points[pivot])))
    for angle in angles:
        copied = copy.solve(direction + sense * (angle - angles[1]))
        assert copied.h == pytest.approx(leg.solve(angle).h, abs=1e-9 * leg.linkage.size)
