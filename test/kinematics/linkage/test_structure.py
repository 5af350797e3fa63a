"""The loop equations and their blocks follow from the bodies."""

from importlib.resources import files
from itertools import pairwise

from klann_ros.kinematics import (
    GeometryError,
    Linkage,
    linkage_from_text,
    LinkageLeg,
    shipped_linkage,
    shipped_linkages,
)
from klann_ros.kinematics.linkage.structure import Bar, Body, Structure
import numpy as np
import pytest
import yaml


def unknowns(linkage: Linkage) -> list[list[str]]:
    """Return the angles of each block by name."""
    return [[linkage.joint_names[j] for j in block.unknowns] for block in linkage.blocks]


def test_the_klann_leg_is_two_dyads_one_after_the_other() -> None:
    linkage = shipped_linkage('klann')
    assert unknowns(linkage) == [['gamma', 'beta'], ['delta', 'theta']]
    assert [block.names for block in linkage.blocks] == [
        ('B', 'D', 'BC', 'DC'),
        ('E', 'G', 'EF', 'FG'),
    ]
    assert linkage.is_dyadic


def test_jansens_leg_is_three_dyads() -> None:
    linkage = shipped_linkage('jansen')
    assert unknowns(linkage) == [['j', 'b'], ['k', 'c'], ['f', 'g']]
    assert all(block.is_dyad for block in linkage.blocks)


def test_stephensons_loops_are_coupled() -> None:
    linkage = shipped_linkage('stephenson')
    (block,) = linkage.blocks
    assert not block.is_dyad
    assert len(block.unknowns) == 4
    assert not linkage.is_dyadic


def test_coupled_loops_with_two_poses_at_one_crank_angle_are_refused() -> None:
    """After a turn of this crank the rockers are on their other side."""
    text = (files('klann_ros.linkages') / 'stephenson.yaml').read_text()
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


def split(body: Body) -> Body:
    """Return a body whose first bar has three points more on it; a line has no length to part."""
    if body.slides:
        return body
    first, *others = body.bars
    names = [first.start, *(f'{first.start}{k}{body.angle}' for k in range(3)), first.end]
    parts = [Bar(p, q) for p, q in pairwise(names)]
    return body._replace(bars=(*parts, *others))


@pytest.mark.parametrize('name', shipped_linkages())
def test_points_along_a_bar_change_neither_blocks_nor_arcs(name: str) -> None:
    plain = shipped_linkage(name)
    structure = plain.structure
    finer_structure = Structure(
        structure.pivots, tuple(map(split, structure.bodies)), structure.foot
    )
    numbers = []
    given = {
        (d.kind, d.place): v for d, v in zip(structure.dimensions, plain.numbers, strict=True)
    }
    # Each body's first bar has become four, of a quarter of its length.
    old = [
        n for n, _ in enumerate(structure.bars) for _ in range(4 if n in structure.straight else 1)
    ]
    for dimension in finer_structure.dimensions:
        kind, place = dimension.kind, dimension.place
        of = place if kind in ('x', 'y') else old[place]
        quarter = kind == 'length' and of in structure.straight
        numbers.append(given.get((kind, of), 0.0) / (4 if quarter else 1))
    finer = Linkage(finer_structure, numbers, start=plain.start_guess)
    assert unknowns(finer) == unknowns(plain)
    assert finer.assembly == plain.assembly
    assert LinkageLeg(finer).reachable_arcs() == LinkageLeg(plain).reachable_arcs()
    pose, other = LinkageLeg(finer).solve(1.0), LinkageLeg(plain).solve(1.0)
    assert pose.h == pytest.approx(other.h, abs=1e-14)


def described(pivots: dict, bodies: dict[str, str], start: list[float]) -> dict:
    """Return a file's content; 'O-A 1, A-B 2' are a body's bars with their lengths."""
    return {
        'name': 'test',
        'units': {'angle': 'deg'},
        'pivots': pivots,
        'crank': 'a',
        'foot': 'B',
        'bodies': {
            name: {
                'bars': [
                    {'from': bar[0], 'to': bar[2], 'length': float(bar[4:])}
                    for bar in bars.split(', ')
                ]
            }
            for name, bars in bodies.items()
        },
        'start': dict(zip(bodies, start, strict=True)),
    }


NEAR = {'O': [0, 0], 'P': [3, 0]}
FOUR_BAR = {'a': 'O-A 1', 'b': 'A-B 3', 'c': 'P-B 3'}


@pytest.mark.parametrize(
    ('pivots', 'bodies', 'start', 'reason'),
    [
        (NEAR, {'a': 'O-B 1'}, [0], 'no loop closes'),
        (
            NEAR,
            {'a': 'O-A 1', 'b': 'A-B 3', 'c': 'B-C 3', 'd': 'P-C 3'},
            [0, 0, 0, 0],
            '3 unknown angles (b, c, d) and 2 loop equations',
        ),
        (
            NEAR,
            {'a': 'O-A 1', 'b': 'A-B 3', 'c': 'P-B 3, B-C 1', 'd': 'C-D 3'},
            [0, 0, 0, 0],
            'd: turns freely, since no loop closes over it',
        ),
        (
            {**NEAR, 'Q': [5, 5]},
            {**FOUR_BAR, 'd': 'Q-B 3'},
            [0, 0, 0, 0],
            'd: cannot move, since 2 loop equations stand against 1 unknown angle',
        ),
        (
            NEAR,
            {**FOUR_BAR, 'd': 'X-Y 3'},
            [0, 0, 0, 0],
            'body d (X-Y) is connected to no pivot',
        ),
        (
            {**NEAR, 'P': [9, 0]},
            FOUR_BAR,
            [0, 40, 120],
            'it cannot be assembled near its start: Newton-Raphson finds no pose at the crank',
        ),
        (
            {**NEAR, 'P': [5, 0]},
            {'a': 'O-A 1', 'b': 'A-B 2', 'c': 'P-B 2'},
            [0, 0, 180],
            'singular',
        ),
    ],
    ids=['no loop', 'too free', 'loose body', 'jammed', 'island', 'too far', 'singular start'],
)
def test_what_does_not_move_in_one_way_is_refused(
    pivots: dict, bodies: dict[str, str], start: list[float], reason: str
) -> None:
    text = yaml.safe_dump(described(pivots, bodies, start), sort_keys=False)
    with pytest.raises(GeometryError) as caught:
        linkage_from_text(text, 'test.yaml')
    assert reason in str(caught.value)
    assert str(caught.value).startswith('test.yaml holds no linkage: ')
    assert '\n' not in str(caught.value)
