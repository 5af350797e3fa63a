"""Linkages that others have published by coordinates: imported, and solved by two methods."""

from cmath import phase
from collections.abc import Mapping
from math import radians
from pathlib import Path
from typing import Any

from klann_ros.importing.command import file_text
from klann_ros.importing.forms import read_mechanism
from klann_ros.importing.mechanism import linkage_content
from klann_ros.kinematics import linkage_from_text, LinkageLeg
from mechanism_texts import WRITERS
from natural_coordinates import NaturalCoordinates, read_rows
import pytest
from yaml_tables import read_table

TABLES = read_table(Path(__file__).with_name('mechanisms.yaml'))
STEPS = 120
PER_POSE = 6
# The position of a joint that a source prints, as a part of the linkage's size.
PRINTED_DIGITS = 1e-6


def named(entry: Mapping[str, Any]) -> str:
    return str(entry['name'])


class ImportedLeg:
    """A linkage by its text in another program's form, and its joints over rotations."""

    def __init__(self, text: str, form: str) -> None:
        mechanism = read_mechanism(text)
        self._unit = 1e-3 * mechanism.unit
        content = linkage_content(mechanism, '', '', 0.0)
        linkage = linkage_from_text(file_text('x', 'y', content), form)
        self._leg = LinkageLeg(linkage)
        start, end = content['links'][content['crank']][:2]
        places = content['points']
        self._start = phase(complex(*places[end]) - complex(*places[start]))

    def joints(self, rotation: float) -> dict[str, complex]:
        """Return the joints at a rotation of the crank [rad], in the lengths of the text."""
        pose = self._leg.solve(self._start + rotation)
        points = pose.points / self._unit
        names = pose.linkage.structure.points
        return {name: complex(*points[n]) for n, name in enumerate(names)}


@pytest.mark.parametrize('entry', TABLES['mechanisms'], ids=named)
def test_an_imported_linkage_moves_as_its_joints_do(entry: Mapping[str, Any]) -> None:
    rows = read_rows(entry['joints'])
    leg = ImportedLeg(WRITERS[entry['form']](rows), entry['form'])
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
    entry: Mapping[str, Any],
) -> None:
    leg = ImportedLeg(WRITERS[entry['form']](read_rows(entry['joints'])), entry['form'])
    for degrees, positions in entry['positions'].items():
        joints = leg.joints(radians(degrees))
        for number, position in positions.items():
            assert abs(joints[f'P{number}'] - complex(*position)) < 1e-6
