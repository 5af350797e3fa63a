"""The lab passes change points along the tangent: closed forms have the same feet."""

from typing import Any

from change_point_linkages import change_point_file, FEET, resting_parallelogram
from klann_ros.kinematics import GeometryError, linkage_from_text, linkage_poses
from lab_solver import in_node, NODE
import numpy as np
import pytest

if NODE is None:
    pytest.skip('no node: apt-get install nodejs', allow_module_level=True)

TURN = 2.0 * np.pi
# Ten turns both ways, the change points among the angles, and beside these.
BESIDE = [0.0, 1e-9, 1e-6, 1e-3, 4.9e-3, 5.1e-3]
POINTS = np.arange(-40, 41)[:, None] * TURN / 4.0 + np.array(BESIDE + [-b for b in BESIDE])
ALPHAS = np.concatenate([np.linspace(-10.0, 10.0, 801) * TURN, POINTS.ravel()])
SCRIPT = """
function poses(linkage, alphas) {
  const { structure, changes } = linkage;
  const foot = structure.points.indexOf(structure.foot);
  return {
    period: changes.period, points: changes.points, arcs: reachableArcs(linkage),
    feet: alphas.map((alpha) => (poseAt(linkage, alpha).points || { [foot]: [null, null] })[foot]),
  };
}

function answer({ texts, alphas }) {
  const answers = {};
  for (const [name, text] of Object.entries(texts)) {
    const read = (choice) => readFile(`${text}\\nat_change_points: ${choice}\\n`, text).linkage;
    answers[name] = poses(read('parallel'), alphas);
    if (!read('parallel').isDyadic) continue;
    for (const choice of ['crossed', 'sign']) answers[name][choice] = poses(read(choice), alphas);
    const { structure, numbers, kept, changes } = read('parallel');
    // The signs of another angle are told with that angle.
    const signs = changes.signsAt(alphas[0] + 1);
    const moved = new Linkage(structure, numbers, { ...kept, signs, reference: alphas[0] + 1 });
    answers[name].moved = poses(moved, alphas);
  }
  return answers;
}
"""


@pytest.fixture(scope='module')
def passed() -> dict[str, Any]:
    texts = {name: change_point_file(name).read_text(encoding='utf-8') for name in FEET}
    answers: dict[str, Any] = in_node(SCRIPT, {'texts': texts, 'alphas': ALPHAS.tolist()})
    return answers


def feet(answer: dict[str, Any]) -> np.ndarray:
    return np.array(answer['feet'], dtype=float) @ [1.0, 1j]


@pytest.mark.slow
@pytest.mark.parametrize('name', FEET)
def test_it_goes_along_the_tangent_over_ten_turns_both_ways(
    passed: dict[str, Any], name: str
) -> None:
    expected = FEET[name](ALPHAS)
    size = np.abs(expected).max()
    assert np.abs(feet(passed[name]) - expected).max() <= 1e-12 * size
    assert passed[name]['arcs'] == [[0, pytest.approx(TURN)]]


@pytest.mark.parametrize('name', ['parallelogram', 'side_rod', 'galloway', 'two_turns'])
def test_signs_may_be_told_at_any_angle(passed: dict[str, Any], name: str) -> None:
    assert feet(passed[name]['moved']) == pytest.approx(feet(passed[name]), abs=1e-13)


def test_it_is_back_after_the_turns_that_it_needs(passed: dict[str, Any]) -> None:
    periods = {name: answer['period'] for name, answer in passed.items()}
    twice = {'kite_on_crank', 'slotted_arm', 'two_turns', 'platform_two_turns'}
    assert periods == {name: 2 if name in twice else 1 for name in FEET}
    degrees = [np.degrees(point['alpha']) for point in passed['side_rod']['points']]
    assert degrees == pytest.approx([90.0, 180.0, 270.0, 360.0])
    assert [point['block'] for point in passed['side_rod']['points']] == [2, 1, 2, 1]
    is_free = {
        name: any(p.get('isFree') for p in answer['points']) for name, answer in passed.items()
    }
    assert [name for name in FEET if is_free[name]] == ['kite_on_crank', 'slotted_arm']


def test_crossed_is_the_antiparallelogram_and_sign_turns_back(passed: dict[str, Any]) -> None:
    """C of the antiparallelogram is A mirrored in the middle normal of BD; P turns with B-C."""
    pin = 0.04 * np.exp(1j * ALPHAS)
    along = (0.1 - pin) / np.abs(0.1 - pin)
    # Mirrored: C + A = B + D for the parallelogram, and along BD they stay, across it they turn.
    parallel = 0.1 + pin
    joint = pin + along**2 * np.conj(parallel - pin)
    foot = pin - 0.8j * (joint - pin)
    assert feet(passed['parallelogram']['crossed']) == pytest.approx(foot, abs=1e-12)
    upper = np.sin(ALPHAS) > 0.01
    sign = feet(passed['parallelogram']['sign'])
    assert sign[upper] == pytest.approx(FEET['parallelogram'](ALPHAS)[upper], abs=1e-12)
    lower = np.sin(ALPHAS) < -0.01
    assert sign[lower] == pytest.approx(foot[lower], abs=1e-12)


def test_at_a_contact_of_fourth_order_the_sign_stays() -> None:
    text, foot = resting_parallelogram()
    answer = in_node(SCRIPT, {'texts': {'': text}, 'alphas': ALPHAS.tolist()})['']
    assert [point['flips'] for point in answer['points']] == [False]
    assert np.abs(feet(answer) - foot(ALPHAS)).max() <= 1e-11


def random_chain(rng: np.random.Generator) -> str:
    """Return a four-bar with l + s = p + q and a parallelogram on its rocker, which may jam."""
    shortest, middle, further = sorted(rng.integers(2, 40, 3).tolist())
    lengths = [shortest, middle, further, middle + further - shortest]
    ground, crank, coupler, rocker = rng.permutation(lengths).tolist()
    side, width = rng.integers(5, 30, 2).tolist()
    sense = 'true' if rng.random() < 0.5 else 'false'
    choice = 'crossed' if rng.random() < 0.5 else 'parallel'
    return f"""
name: chain
units: {{length: mm, angle: deg}}
pivots: {{A: [0, 0], D: [{ground}, 0], E: [{ground}, {width}]}}
crank: crank
foot: P
at_change_points: {choice}
bodies:
  crank: {{bars: [{{from: A, to: B, length: {crank}}}], clockwise: {sense}}}
  coupler: {{bars: [{{from: B, to: C, length: {coupler}}}]}}
  rocker:
    bars:
      - {{from: D, to: C, length: {rocker}}}
      - {{from: D, to: F, length: {side}, bend: {rng.integers(0, 360)}}}
  link: {{bars: [{{from: E, to: G, length: {side}}}]}}
  bar: {{bars: [{{from: F, to: G, length: {width}}}, {{from: F, to: P, length: 7, bend: 50}}]}}
assembly: {rng.choice([-1, 1], 2).tolist()}
"""


RANDOM = """
function answer({ texts, alphas }) {
  return texts.map((text) => {
    const { linkage } = readFile(text, text);
    const { structure, changes } = linkage;
    const foot = structure.points.indexOf(structure.foot);
    const at = (alpha) => (poseAt(linkage, alpha).points || { [foot]: [null, null] })[foot];
    return { period: changes.period, points: changes.points, feet: alphas.map(at) };
  });
}
"""


@pytest.mark.slow
def test_random_chains_have_the_change_points_and_feet_of_python() -> None:
    rng = np.random.default_rng(45)
    alphas = rng.uniform(-40.0, 40.0, 60)
    texts = [random_chain(rng) for _ in range(40)]
    answers = in_node(RANDOM, {'texts': texts, 'alphas': alphas.tolist()})
    further = 0
    for text, answer in zip(texts, answers, strict=True):
        linkage = linkage_from_text(text, 'chain')
        ours = linkage.change_points
        theirs = [(point['block'], point['alpha']) for point in answer['points']]
        assert answer['period'] == ours.period
        assert [block for block, _ in theirs] == [point.block for point in ours.points]
        betas = [point.beta for point in ours.points]
        assert [beta for _, beta in theirs] == pytest.approx(betas, abs=1e-9)
        expected = linkage_poses(linkage, alphas).h @ [1.0, 1j]
        found = feet(answer)
        np.testing.assert_array_equal(np.isnan(found), np.isnan(expected))
        assert np.nanmax(np.abs(found - expected)) <= 1e-11 * linkage.size
        further += len({block for block, _ in theirs}) > 1
    assert further >= 5


COUPLED = """
function answer({ texts, alphas }) {
  return texts.map((text) => {
    try {
      const { linkage } = readFile(text, text);
      const foot = linkage.structure.points.indexOf(linkage.structure.foot);
      const at = (alpha) => (poseAt(linkage, alpha).points || { [foot]: [null, null] })[foot];
      const { points } = linkage.changes;
      return { arc: linkage.branch.arc, points: points.length, feet: alphas.map(at) };
    } catch (error) {
      if (!(error instanceof Refusal)) throw error;
      return { refused: error.message };
    }
  });
}
"""


@pytest.mark.slow
def test_coupled_loops_pass_change_points_and_end_as_those_of_python() -> None:
    """Of other lengths they end at singular poses, pass them, or are back as another pose."""
    rng = np.random.default_rng(5)
    alphas = rng.uniform(-20.0, 20.0, 30)
    base = change_point_file('coupled_parallelogram').read_text(encoding='utf-8')
    texts = []
    for n in range(10):
        text = base.replace('F, length: 80', f'F, length: {rng.integers(60, 95)}')
        text = text.replace('E: [80, 60]', f'E: [{rng.integers(60, 90)}, {rng.integers(50, 70)}]')
        # A parallelogram no more: there is no change point.
        length = 70.0 + rng.uniform(-3.0, 3.0) if n % 2 else 70.0
        texts.append(text.replace('D, length: 70}', f'D, length: {length}}}'))
    outcomes = set()
    answers = in_node(COUPLED, {'texts': texts, 'alphas': alphas.tolist()})
    for text, answer in zip(texts, answers, strict=True):
        try:
            linkage = linkage_from_text(text, 'coupled')
            branch = linkage.branch
        except GeometryError:
            assert 'refused' in answer
            continue
        assert answer['arc'] == pytest.approx(branch.arc, abs=1e-9)
        assert answer['points'] == len(linkage.change_points.points)
        expected = linkage_poses(linkage, alphas).h @ [1.0, 1j]
        np.testing.assert_array_equal(np.isnan(feet(answer)), np.isnan(expected))
        assert np.nanmax(np.abs(feet(answer) - expected)) <= 1e-12
        outcomes.add((answer['points'] > 0, branch.arc == (0.0, TURN)))
    assert outcomes >= {(True, True), (False, False)}
