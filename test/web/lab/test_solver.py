"""The lab's solver is the kinematics: the same structure, poses, refusals, arcs and figures."""

from itertools import product
from typing import Any

from klann_ros.kinematics import (
    assembly_poses,
    foot_path,
    FourBar,
    GeometryError,
    Grashof,
    linkage_poses,
    LinkageLeg,
    NotConvergedError,
    reachable_arcs,
    shipped_linkage,
    shipped_linkages,
    UnreachableError,
)
from lab_solver import in_node, NODE, poses_in_node, TEXTS, varied_numbers
import numpy as np
import pytest

Answers = dict[str, list[Any]]
Cases = dict[str, list[dict[str, Any]]]

if NODE is None:
    pytest.skip('no node: apt-get install nodejs', allow_module_level=True)

LEGS, ANGLES = 10, 40
# Coupled loops are followed all round for each leg.
COUPLED_LEGS = 2
# Of the linkage's size, and more where a dyad is nearly in line.
NEAR = 1e-12
# Turning fully and not, sliding, coupled: to follow a foot takes long.
FIGURES = ['klann', 'peaucellier', 'quick_return', 'stephenson', 'walker_six_bar', 'watt_six_bar']

DESCRIBE = """
function answer({ texts, figures }) {
  const answers = {};
  for (const [name, text] of Object.entries(texts)) {
    const { linkage, start } = readFile(text, texts.klann);
    const { structure } = linkage;
    const arcs = figures.includes(name) ? reachableArcs(linkage) : [];
    const turn = turnOf(linkage, arcs);
    const { u } = poseAt(linkage, start);
    answers[name] = {
      groups: structure.groups, signs: linkage.signs, numbers: linkage.numbers, arcs,
      dimensions: structure.dimensions.map(({ name }) => name), points: structure.points,
      names: linkage.blocks.map((block) => block.names), closing: structure.paths.closing,
      transmission: linkage.blocks.map((block) => block.transmissionAngle(u)),
      clearances: linkage.blocks.map((block) => block.clearance(u)), start,
      stride: turn.x.greatest - turn.x.least, lift: turn.y.greatest - turn.y.least,
      assemblies: assemblyPoses(linkage, start, 5000).map(({ x }) => x.slice(1)),
    };
  }
  return answers;
}
"""

ITERATES = """
function answer({ texts, cases }) {
  const { linkage } = readFile(texts.klann, texts.klann);
  return cases.map(([alpha, ...guess]) => newtonRaphson(linkage, [alpha, ...guess], 50, 1e-12));
}
"""


@pytest.fixture(scope='module')
def described() -> dict[str, Any]:
    answers: dict[str, Any] = in_node(DESCRIBE, {'texts': TEXTS, 'figures': FIGURES})
    return answers


@pytest.mark.parametrize('name', shipped_linkages())
def test_the_structure_is_the_same(described: dict[str, Any], name: str) -> None:
    linkage = shipped_linkage(name)
    answer = described[name]
    structure = linkage.structure
    assert answer['groups'] == [list(group) for group in structure.groups]
    assert answer['signs'] == list(linkage.assembly)
    assert answer['dimensions'] == list(linkage.dimensions)
    assert answer['numbers'] == pytest.approx(linkage.numbers, rel=1e-15)
    assert answer['points'] == list(structure.points)
    assert answer['names'] == [list(block.names) for block in linkage.blocks]
    assert answer['closing'] == list(structure.paths.closing)


@pytest.mark.parametrize('name', FIGURES)
def test_the_figures_are_the_same(described: dict[str, Any], name: str) -> None:
    linkage = shipped_linkage(name)
    answer = described[name]
    assert np.array(answer['arcs']) == pytest.approx(np.array(reachable_arcs(linkage)), abs=1e-12)
    path = foot_path(LinkageLeg(linkage))
    # Where arcs end the crank angle's last digit moves the foot.
    assert answer['stride'] == pytest.approx(path.stride, abs=1e-9)
    assert answer['lift'] == pytest.approx(path.lift, abs=1e-9)
    pose = LinkageLeg(linkage).solve(answer['start'])
    assert answer['transmission'] == pytest.approx(pose.transmission_angles, abs=1e-11)
    has_clearance = [block.is_dyad and block.two_branches for block in linkage.blocks]
    ours = np.array(answer['clearances'], dtype=float)[has_clearance]
    assert ours == pytest.approx(np.array(pose.clearances)[has_clearance], abs=1e-12)


@pytest.mark.parametrize('name', shipped_linkages())
def test_the_assemblies_are_the_same(described: dict[str, Any], name: str) -> None:
    answer = described[name]
    expected = [pose.x for pose in assembly_poses(shipped_linkage(name), answer['start'])]
    errors = np.array(answer['assemblies']) - np.array(expected)
    slides = [body.slides for body in shipped_linkage(name).structure.bodies[1:]]
    errors = np.where(slides, errors, np.remainder(errors + np.pi, 2.0 * np.pi) - np.pi)
    assert np.abs(errors).max() < 1e-9


@pytest.fixture(scope='module')
def random_legs() -> Cases:
    rng = np.random.default_rng(20_260_722)
    cases = {}
    for name in shipped_linkages():
        linkage = shipped_linkage(name)
        count, share = (LEGS, 0.1) if linkage.is_dyadic else (COUPLED_LEGS, 0.02)
        numbers = varied_numbers(linkage.numbers, rng, count, share)
        alphas = rng.uniform(-7.0, 7.0, (count, ANGLES))
        cases[name] = []
        for leg_numbers, leg_alphas in zip(numbers.tolist(), alphas.tolist(), strict=True):
            cases[name].append({'numbers': leg_numbers, 'alphas': leg_alphas})
    return cases


@pytest.fixture(scope='module')
def solved(random_legs: Cases) -> Answers:
    return poses_in_node(random_legs)


@pytest.mark.parametrize('name', shipped_linkages())
def test_random_legs_have_the_same_poses(random_legs: Cases, solved: Answers, name: str) -> None:
    base = shipped_linkage(name)
    closed = 0
    for case, answer in zip(random_legs[name], solved[name], strict=True):
        try:
            linkage = base.varied(dict(zip(base.dimensions, case['numbers'], strict=True)))
        except GeometryError:
            assert 'refused' in answer
            continue
        poses = linkage_poses(linkage, np.array(case['alphas']), points=True)
        assert poses.points is not None
        # The foot may be placed where other points cannot be.
        closes = ~np.isnan(poses.points).any(axis=(1, 2))
        assert [('points' in pose) for pose in answer] == closes.tolist()
        for pose, points in zip(answer, poses.points, strict=True):
            if 'points' in pose:
                near = NEAR * max(1.0, linkage.size) / min(1.0, 50.0 * pose['sine'])
                assert np.abs(np.array(pose['points']) - points).max() <= near
        closed += int(closes.sum())
    assert closed > 10


def test_jams_are_those_of_python(random_legs: Cases, solved: Answers) -> None:
    base = shipped_linkage('klann')
    reported = 0
    for case, answer in zip(random_legs['klann'], solved['klann'], strict=True):
        linkage = base.varied(dict(zip(base.dimensions, case['numbers'], strict=True)))
        for alpha, pose in zip(case['alphas'], answer, strict=True):
            if 'points' not in pose:
                with pytest.raises(UnreachableError) as info:
                    LinkageLeg(linkage).closed_form(alpha)
                assert (info.value.dyad, info.value.stretched) == (pose['block'], pose['isFar'])
                assert info.value.shortfall == pytest.approx(pose['shortfall'], abs=1e-12)
                reported += 1
    assert reported > 10


def test_invalid_dimensions_are_refused_by_both() -> None:
    cases: Cases = {'klann': [], 'jansen': [], 'slider_crank': []}
    for name, invalid_legs in cases.items():
        linkage = shipped_linkage(name)
        lengths = [n for n, d in enumerate(linkage.structure.dimensions) if d.is_length]
        for n, value in product(lengths, [0.0, -0.1, 1e300, 1e-300, None]):
            numbers: list[float | None] = [*linkage.numbers]
            numbers[n] = value
            invalid_legs.append({'numbers': numbers, 'alphas': [0.0]})
            with pytest.raises(GeometryError):
                linkage.varied({[*linkage.dimensions][n]: np.nan if value is None else value})
    for answers in poses_in_node(cases).values():
        assert all('refused' in answer and '\n' not in answer['refused'] for answer in answers)


def test_iterates_are_the_textbooks_wherever_they_lead() -> None:
    rng = np.random.default_rng(7)
    cases = rng.uniform(-3.0, 3.0, (20, 5))
    answers = in_node(ITERATES, {'texts': TEXTS, 'cases': cases.tolist()})
    leg = LinkageLeg(shipped_linkage('klann'))
    converged = 0
    for (alpha, *guess), answer in zip(cases, answers, strict=True):
        try:
            theirs = leg.newton(alpha, guess, tolerance=1e-12)
            converged += answer['converged']
        except NotConvergedError as error:
            theirs = error.iterates
        # Until chaos takes over what rounding has begun.
        count = min(4, len(theirs), len(answer['x']))
        first = np.array(answer['x'])[:count, 1:]
        assert first == pytest.approx(theirs[:count], rel=1e-7, abs=1e-7)
    assert converged > 10


GRASHOF = """
function answer({ texts, lengths }) {
  const loops = Object.values(texts).map((text) => fourBarOf(readFile(text, texts.klann).linkage));
  return { loops, laws: lengths.map(grashofOf) };
}
"""


LIMITS = """
function answer({ text, lengths }) {
  const base = readFile(text, text).linkage;
  const names = ['O4.x', 'O2-A', 'A-B', 'O4-B'];
  return lengths.map((row) => {
    const numbers = base.structure.dimensions.map(({ name }) => row[names.indexOf(name)] || 0);
    const linkage = base.with(numbers);
    const turn = turnOf(linkage, reachableArcs(linkage));
    return rockerLimits(linkage, turn, fourBarOf(linkage).rocker);
  });
}
"""


def test_a_rocker_is_stationary_where_crank_and_coupler_are_in_line() -> None:
    lengths = [(0.18, 0.08, 0.2, 0.15), (0.3, 0.1, 0.25, 0.2), (0.3, 0.1, 0.35, 0.2)]
    # With the rocker at the left of the crank its angle passes 180 deg.
    turned = [(-ground, *bars) for ground, *bars in lengths]
    answers = in_node(LIMITS, {'text': TEXTS['four_bar'], 'lengths': [*lengths, *turned]})
    for row, answer, turned_answer in zip(lengths, answers, answers[3:], strict=False):
        limits = FourBar(*row).rocker_limits
        found = [answer[f'{end}{at}'] for end in ('least', 'greatest') for at in ('', 'At')]
        stretched, folded = limits.stretched, limits.folded
        expected = [stretched.theta4, stretched.theta2, folded.theta4, folded.theta2]
        assert np.exp(1j * np.array(found)) == pytest.approx(
            np.exp(1j * np.array(expected)), abs=2e-7
        )
        for law in (answer, turned_answer):
            assert law['greatest'] - law['least'] == pytest.approx(limits.swing, abs=1e-12)


def test_grashofs_law_is_the_same() -> None:
    random = np.random.default_rng(5)
    rows = [*(0.05 * random.integers(1, 9, (400, 4))), *random.uniform(0.1, 0.4, (200, 4))]
    lengths = [tuple(row.tolist()) for row in rows if 2.0 * max(row) < sum(row)]
    answers = in_node(GRASHOF, {'texts': TEXTS, 'lengths': [*lengths, (0.2, 0.9, 0.2, 0.3)]})
    assert answers['laws'].pop()['kind'] == ''
    kinds = set()
    for row, law in zip(lengths, answers['laws'], strict=True):
        expected = Grashof(row)
        assert (law['kind'], law['motion']) == (expected.class_, expected.motion), row
        kinds.add((law['kind'], law['motion']))
    assert len(kinds) == 9
    loops = dict(zip(TEXTS, answers['loops'], strict=True))
    assert loops['four_bar']['lengths'] == pytest.approx([0.18, 0.08, 0.2, 0.15])
    ground = np.hypot(0.35, 0.09)
    assert loops['klann']['lengths'] == pytest.approx([ground, 0.12, 0.35, 0.14])
    assert loops['klann']['names'] == ['alpha', 'gamma', 'beta']
    without = {'slider_crank', 'quick_return', 'scotch_yoke', 'stephenson'}
    assert without <= {name for name, loop in loops.items() if loop is None}
