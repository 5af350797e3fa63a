"""The loop equations and their blocks follow from the bodies."""

from pathlib import Path

from klann_ros.kinematics import (
    GeometryError,
    Linkage,
    linkage_from_text,
    LinkageLeg,
    shipped_linkage,
    shipped_linkages,
)
from klann_ros.kinematics.linkage.file import SHIPPED
import numpy as np
import pytest
import yaml
from yaml_tables import read_table


def unknowns(linkage: Linkage) -> list[list[str]]:
    """Return the angles of each block by name."""
    return [[linkage.joint_names[j] for j in block.unknowns] for block in linkage.blocks]


@pytest.mark.parametrize(
    ('name', 'expected'),
    [
        ('klann', [['gamma', 'beta'], ['delta', 'theta']]),
        ('jansen', [['j', 'b'], ['k', 'c'], ['f', 'g']]),
        ('stephenson', None),
    ],
)
def test_loops_are_dyads_or_coupled(name: str, expected: list[list[str]] | None) -> None:
    linkage = shipped_linkage(name)
    assert linkage.is_dyadic is (expected is not None)
    assert all(block.is_dyad is linkage.is_dyadic for block in linkage.blocks)
    if expected:
        assert unknowns(linkage) == expected
    else:
        assert [len(names) for names in unknowns(linkage)] == [4]


def test_coupled_loops_with_two_poses_at_one_crank_angle_are_refused() -> None:
    """After a turn of this crank the rockers are on their other side."""
    text = (SHIPPED / 'stephenson.yaml').read_text(encoding='utf-8')
    for old, new in (
        ('[180, 200]', '[141, 107]'),
        ('length: 25}', 'length: 77}'),
        ('length: 115}', 'length: 94}'),
        ('from: A, to: C, length: 160', 'from: A, to: C, length: 118'),
        ('from: B, to: D, length: 160', 'from: B, to: D, length: 86'),
    ):
        assert text.count(old) == 1
        text = text.replace(old, new)
    with pytest.raises(GeometryError, match='not back where they were after a turn of the crank'):
        linkage_from_text(text, 'two turns').branch.x(0.0)


@pytest.mark.parametrize('name', ['klann', 'jansen', 'stephenson'])
def test_the_blocks_make_phi_block_lower_triangular(name: str) -> None:
    linkage = shipped_linkage(name)
    phi = linkage.phi(linkage.start[0], linkage.start[1:])
    done: list[int] = []
    for loop, block in zip(np.split(phi, len(phi) // 2), per_loop(linkage), strict=True):
        done += [j for j in block.unknowns if j not in done]
        later = [j - 1 for j in range(1, len(linkage.joint_names)) if j not in done]
        assert not loop[:, later].any()


def per_loop(linkage: Linkage) -> list:
    """Return each loop's block, for linkages whose loops are in the order of their blocks."""
    return [block for block in linkage.blocks for _ in range(len(block.unknowns) // 2)]


@pytest.mark.parametrize('name', shipped_linkages())
def test_points_along_a_bar_change_neither_blocks_nor_arcs(name: str) -> None:
    plain = shipped_linkage(name)
    content = yaml.safe_load((SHIPPED / f'{name}.yaml').read_text(encoding='utf-8'))
    for angle, body in content['bodies'].items():
        if 'slides' not in body:
            first, *further_bars = body['bars']
            middle = f'{first["from"]}_{angle}'
            half = first['length'] / 2
            ends = ((first['from'], middle), (middle, first['to']))
            halves = [{'from': p, 'to': q, 'length': half} for p, q in ends]
            body['bars'] = [*halves, *further_bars]
    finer = linkage_from_text(yaml.safe_dump(content, sort_keys=False), 'finer')
    assert unknowns(finer) == unknowns(plain)
    assert finer.assembly == plain.assembly
    assert LinkageLeg(finer).reachable_arcs() == LinkageLeg(plain).reachable_arcs()
    pose, plain_pose = LinkageLeg(finer).solve(1.0), LinkageLeg(plain).solve(1.0)
    assert pose.h == pytest.approx(plain_pose.h, abs=1e-14)


def described(case: dict) -> dict:
    """Return a file's content."""
    bodies = {}
    for name, texts in case['bodies'].items():
        bars = []
        for text in texts.split(', '):
            start, end, length = text.replace('-', ' ').split()
            bars.append({'from': start, 'to': end, 'length': float(length)})
        bodies[name] = {'bars': bars}
    head = {'name': 'test', 'units': {'angle': 'deg'}, 'crank': 'a', 'foot': 'B'}
    start_angles = dict(zip(bodies, case['start'], strict=True))
    return {**head, 'pivots': case['pivots'], 'bodies': bodies, 'start': start_angles}


REFUSED = read_table(Path(__file__).with_name('refused_structures.yaml'))


@pytest.mark.parametrize('case', REFUSED.values(), ids=REFUSED)
def test_structures_without_one_degree_of_freedom_are_refused(case: dict) -> None:
    text = yaml.safe_dump(described(case), sort_keys=False)
    with pytest.raises(GeometryError) as caught:
        linkage_from_text(text, 'test.yaml')
    assert case['reason'] in str(caught.value)
    assert str(caught.value).startswith('test.yaml holds no linkage: ')
    assert '\n' not in str(caught.value)
