"""A linkage's joints as `export --joints` and `--loops-urdf` write them, read back."""

from cmath import phase
from pathlib import Path

from klann_ros.export.command import main as export
from klann_ros.importing.command import main as import_linkage
from klann_ros.kinematics import linkage_from_file, LinkageLeg, shipped_linkage, shipped_linkages
import numpy as np
import pytest


@pytest.mark.parametrize('option', ['--joints', '--loops-urdf'])
@pytest.mark.parametrize('name', shipped_linkages())
def test_exported_joints_are_read_back(name: str, option: str, tmp_path: Path) -> None:
    exported = tmp_path / 'exported'
    output = tmp_path / 'linkage.yaml'
    assert export([name, option, str(exported)]) == 0
    source = exported / 'robot.urdf' if exported.is_dir() else exported
    assert import_linkage([str(source), '-o', str(output)]) == 0
    leg = LinkageLeg(shipped_linkage(name))
    copy = LinkageLeg(linkage_from_file(output))
    structure = leg.linkage.structure
    # Both cranks have their pivot and another point in common, which need not be the second one.
    start, end = leg.reachable_arcs()[0]
    angles = [start + part * (end - start) for part in (0.1, 0.37, 0.6, 0.9)]
    first = dict(zip(structure.points, leg.solve(angles[1]).points, strict=True))
    pivot, pin = copy.linkage.structure.crank.points[:2]
    direction = phase(complex(*(first[pin] - first[pivot])))
    for angle in angles:
        pose = leg.solve(angle)
        copied = copy.solve(direction + structure.senses[0] * (angle - angles[1]))
        places = dict(zip(copy.linkage.structure.points, copied.points, strict=True))
        tolerance = 1e-9 * leg.linkage.size
        for point, place in zip(structure.points, pose.points, strict=True):
            if len(structure.owners[point]) > 1:
                assert places[point] == pytest.approx(place, abs=tolerance)
        assert np.abs(copied.points - pose.h).max(axis=1).min() <= tolerance
