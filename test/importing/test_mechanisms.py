"""Linkages that others have published by coordinates: imported, and solved by two methods."""

from cmath import phase
from collections.abc import Mapping
from math import radians
from pathlib import Path
from typing import Any

from klann_ros.importing.command import main
from klann_ros.kinematics import linkage_from_file, LinkageLeg
from mechanism_texts import WRITERS
from natural_coordinates import NaturalCoordinates, read_rows
import pytest
from yaml_tables import read_table

TABLES = read_table(Path(__file__).with_name('mechanisms.yaml'))
# Units of length that forms have [mm].
UNITS = {'linkage2': 25.4 / 96.0}
STEPS = 72
PER_POSE = 6


def named(entry: Mapping[str, Any]) -> str:
    return str(entry['name'])


class ImportedLeg:
    """A linkage by its text in another program's form, and its joints over rotations."""

    def __init__(self, entry: Mapping[str, Any], folder: Path) -> None:
        form = entry['form']
        output = folder / 'linkage.yaml'
        assert main([WRITERS[form](read_rows(entry['joints'])), '-o', str(output)]) == 0
        linkage = linkage_from_file(output)
        self._unit = 1e-3 * UNITS.get(form, 1.0)
        self._leg = LinkageLeg(linkage)
        points = read_table(output)['points']
        pivot, pin = linkage.structure.crank.points[:2]
        self._start = phase(complex(*points[pin]) - complex(*points[pivot]))

    def joints(self, rotation: float) -> dict[str, complex]:
        """Return the joints at a rotation of the crank [rad], in the lengths of the text."""
        pose = self._leg.solve(self._start + rotation)
        points = pose.points / self._unit
        names = pose.linkage.structure.points
        return {name: complex(*points[n]) for n, name in enumerate(names)}


@pytest.mark.parametrize('entry', TABLES['mechanisms'], ids=named)
def test_an_imported_linkage_moves_as_its_joints_do(
    entry: Mapping[str, Any], tmp_path: Path
) -> None:
    rows = read_rows(entry['joints'])
    leg = ImportedLeg(entry, tmp_path)
    mechanism = NaturalCoordinates(rows)
    compared = set()
    for step, (rotation, positions) in enumerate(mechanism.turn(STEPS)):
        joints = leg.joints(rotation)
        for number, position in enumerate(positions):
            name = f'P{number}'
            if name in joints and step % PER_POSE == 0:
                compared.add(name)
                assert abs(joints[name] - position) <= 1e-9 * mechanism.size, (name, rotation)
    moving = {f'P{n}' for n, row in enumerate(rows) if 'ground' not in row.links}
    assert moving <= compared


@pytest.mark.parametrize('entry', TABLES['printed'], ids=named)
def test_an_imported_linkage_has_the_positions_that_its_source_prints(
    entry: Mapping[str, Any], tmp_path: Path
) -> None:
    leg = ImportedLeg(entry, tmp_path)
    for degrees, positions in entry['positions'].items():
        joints = leg.joints(radians(degrees))
        for number, position in positions.items():
            assert abs(joints[f'P{number}'] - complex(*position)) < 1e-6
