"""The shipped linkages: their poses have the numbers of their files, read here from the YAML."""

import cmath
from collections.abc import Iterator, Mapping
import math
from typing import Any

from klann_ros.kinematics import (
    KlannLeg,
    linkage_poses,
    LinkageLeg,
    LinkagePose,
    shipped_linkage,
    shipped_linkages,
    Variants,
)
from klann_ros.kinematics.linkage.file import SHIPPED
import numpy as np
import pytest
import yaml

TURN = 2.0 * math.pi
# Cranks that do not turn fully, and where they do [rad]: law of cosines, links in line.
FOLDED, STRETCHED = math.acos(4 / 5), math.acos(-1 / 5)
TOGETHER = math.acos((20**2 + 12**2 - 22**2) / (2 * 20 * 12))
REACHING = math.acos((25**2 + 25**2 - 40**2) / (2 * 25 * 25))
ROCKING = {
    'chebyshev': [(FOLDED, STRETCHED), (TURN - STRETCHED, TURN - FOLDED)],
    'roberts': [(TURN - TOGETHER, TURN + TOGETHER)],
    'peaucellier': [(math.pi + REACHING, 3 * math.pi - REACHING)],
}
METRES = {'m': 1.0, 'cm': 0.01, 'mm': 0.001}


def misfits(content: Mapping[str, Any], pose: LinkagePose) -> Iterator[float]:
    """Yield the distances of points from where the numbers of a file have them [m]."""
    units = {'length': 'm', 'angle': 'rad', **content.get('units', {})}
    metre, radian = METRES[units['length']], {'rad': 1.0, 'deg': math.pi / 180}[units['angle']]
    structure = pose.linkage.structure
    points = {n: complex(*p) for n, p in zip(structure.points, pose.points, strict=True)}
    x = dict(zip(structure.angles, pose.joints, strict=True))
    u = {'ground': 1.0 + 0j}
    # Sliding bodies follow the bodies that carry them.
    for name, body in sorted(content['bodies'].items(), key=lambda item: 'slides' in item[1]):
        sense = -1.0 if body.get('clockwise') else 1.0
        along = body.get('slides', {}).get('along')
        u[name] = u[along] if along else cmath.exp(1j * sense * x[name])
    yield from (abs(points[name] - metre * complex(*p)) for name, p in content['pivots'].items())
    for name, body in content['bodies'].items():
        for line in [body['slides']] if 'slides' in body else []:
            way = x[name] * cmath.exp(1j * radian * line.get('direction', 0.0)) * u[name]
            yield abs(points[line['to']] - points[line['from']] - way)
        for bar in body.get('bars', ()):
            vector, length = points[bar['to']] - points[bar['from']], metre * bar['length']
            if 'brace' not in bar:
                bent = cmath.exp(1j * radian * bar.get('bend', 0.0))
                yield abs(vector - length * bent * u[name])
                continue
            base = points[bar['brace']['from']] - points[bar['from']]
            brace = bar['brace']
            yield abs(abs(vector) - length)
            yield abs(abs(vector - base) - metre * brace['length'])
            is_left = (base.conjugate() * vector).imag > 0.0
            yield 0.0 if is_left == (brace['side'] == 'left') else math.inf


@pytest.mark.parametrize('name', shipped_linkages())
def test_each_pose_has_the_numbers_of_the_file_from_its_start_on(name: str) -> None:
    leg = LinkageLeg(shipped_linkage(name))
    expected_arcs = ROCKING.get(name, [(0.0, TURN)])
    content = yaml.safe_load((SHIPPED / f'{name}.yaml').read_text(encoding='utf-8'))
    arcs = leg.reachable_arcs()
    np.testing.assert_allclose(arcs, expected_arcs, rtol=0, atol=1e-9 if name in ROCKING else 0.0)
    (start, end), *_ = arcs
    # The ends of an arc are singular where a crank does not turn fully.
    ends = 0.01 if name in ROCKING else 0.0
    poses = [leg.solve(a) for a in np.linspace(start + ends, end - ends, 181).tolist()]
    assert max(gap for pose in poses for gap in misfits(content, pose)) <= 1e-14
    # No step leads into another assembly, and the start is in this one.
    points = np.array([pose.points for pose in poses])
    assert np.abs(np.diff(points, axis=0)).max() <= 0.1 * np.ptp(points, axis=(0, 1)).max()
    if 'start' in content:
        radian = 1.0 if content.get('units', {}).get('angle', 'rad') == 'rad' else math.pi / 180
        start_angles = {key: radian * value for key, value in content['start'].items()}
        bodies = leg.linkage.structure.bodies
        pose = leg.solve(start_angles[bodies[0].angle])
        for body, x in zip(bodies, pose.joints, strict=True):
            difference = abs(math.remainder(start_angles[body.angle] - x, TURN))
            assert body.slides or difference <= math.radians(45.0)


def test_the_klann_file_is_the_klann_leg() -> None:
    linkage_leg = LinkageLeg(shipped_linkage('klann'))
    klann_leg = KlannLeg()
    assert linkage_leg.linkage.joint_names == klann_leg.joint_names
    assert linkage_leg.linkage.assembly == klann_leg.geometry.assembly
    order = [linkage_leg.linkage.structure.points.index(letter) for letter in 'ABCDEFGH']
    for alpha in np.linspace(0.0, TURN, 37).tolist():
        pose, klann_pose = linkage_leg.solve(alpha), klann_leg.solve(alpha)
        for name in ('x', 'h', 'coefficients', 'sines', 'clearances', 'condition'):
            np.testing.assert_allclose(getattr(pose, name), getattr(klann_pose, name), atol=1e-12)
        np.testing.assert_allclose(pose.points[order], klann_pose.points, rtol=0, atol=1e-12)
        # SEM 104 measures delta + theta outside the joint F.
        mu_1, mu_2 = klann_pose.transmission_angles
        np.testing.assert_allclose(pose.transmission_angles, (mu_1, math.pi - mu_2))


@pytest.mark.parametrize(
    'name',
    [
        'klann',
        'stephenson',
        'slider_crank',
        'quick_return',
        'scotch_yoke',
        'parallelogram',
        'side_rod',
    ],
)
def test_a_moved_linkage_moves_with_its_crank(name: str) -> None:
    linkage = shipped_linkage(name)
    factor = 1.7 * np.exp(2.5j)
    moved = linkage.moved(factor, 0.3 - 0.2j)
    alphas = np.linspace(0.0, 6.0, 25)
    crank_sense = linkage.structure.senses[0]
    drawn = linkage_poses(linkage, alphas, points=True)
    turned = linkage_poses(moved, alphas + crank_sense * 2.5, points=True)
    assert not drawn.reason.any()
    expected = factor * (drawn.points @ (1.0, 1j)) + 0.3 - 0.2j
    assert np.abs(turned.points @ (1.0, 1j) - expected).max() < 1e-9 * linkage.size


def test_a_single_variant_of_coupled_loops_is_solved_with_its_own_numbers() -> None:
    linkage = shipped_linkage('stephenson')
    length = linkage.dimensions['C-P'] * 1.1
    (h,) = linkage_poses(Variants(linkage, {'C-P': [length]}), [0.5]).h
    expected = linkage_poses(linkage.varied({'C-P': length}), [0.5]).h
    assert h.tolist() == expected.tolist()
