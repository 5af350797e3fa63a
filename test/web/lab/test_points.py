"""A file by points means the same linkage to the lab, in the same poses, as to Python."""

from pathlib import Path
from typing import Any

from klann_ros.kinematics import (
    GeometryError,
    linkage_from_text,
    linkage_poses,
    LinkagePose,
    shipped_linkage,
    shipped_linkages,
)
from klann_ros.sanitize.yaml_text import parse
from lab_solver import in_node, NODE, POSES, TEXTS
import numpy as np
from point_files import firm_pose, point_file
import pytest
from random_linkages import random_linkage
from yaml_tables import read_table

if NODE is None:
    pytest.skip('no node: apt-get install nodejs', allow_module_level=True)

FILES = read_table(Path(__file__).parents[2] / 'kinematics' / 'linkage' / 'point_files.yaml')
READ = """
function answer({ texts, klann }) {
  return texts.map((text) => {
    try {
      const { linkage, content, start } = readFile(text, klann);
      const saved = linkageText(linkage, content, poseAt(linkage, start).x, 'saved');
      const { numbers, signs, structure } = linkage;
      const names = structure.dimensions.map(({ name }) => name);
      return { numbers, signs, names, saved };
    } catch (error) {
      if (error instanceof Refusal) return { refused: Object.values(error.texts) };
      return { crashed: String(error.stack) };
    }
  });
}
"""


def read_in_node(texts: list[str]) -> list[dict[str, Any]]:
    answers: list[dict[str, Any]] = in_node(READ, {'texts': texts, 'klann': TEXTS['klann']})
    for answer in answers:
        assert 'crashed' not in answer, answer
    return answers


@pytest.fixture(scope='module')
def poses() -> list[LinkagePose]:
    """Return a pose of each shipped linkage, and of random ones."""
    linkages = [shipped_linkage(name) for name in shipped_linkages()]
    for seed in range(10):
        linkages += [random_linkage(seed, coupled=coupled) for coupled in (False, True)]
    firm_poses = []
    for linkage in linkages:
        try:
            firm_poses.append(firm_pose(linkage))
        except GeometryError:
            continue
    assert len(firm_poses) > 36
    return firm_poses


@pytest.mark.slow
def test_numbers_and_assembly_are_those_of_python(poses: list[LinkagePose]) -> None:
    texts = [point_file(pose, directions=bool(n % 2)) for n, pose in enumerate(poses)]
    texts += [FILES['four-bar'], FILES['shaper']]
    for text, answer in zip(texts, read_in_node(texts), strict=True):
        linkage = linkage_from_text(text, 'points')
        assert [*linkage.dimensions] == answer['names']
        assert answer['numbers'] == pytest.approx(linkage.numbers, rel=1e-14, abs=1e-15)
        assert answer['signs'] == [*linkage.assembly]
        # The lab saves bars.
        assert 'points' not in parse(answer['saved'])
        saved = linkage_from_text(answer['saved'], 'saved')
        assert saved.structure == linkage.structure
        assert saved.numbers == pytest.approx(linkage.numbers, rel=1e-14, abs=1e-15)


def test_poses_are_those_of_lengths(poses: list[LinkagePose]) -> None:
    alphas = np.linspace(-3.0, 3.0, 13)
    texts = [point_file(pose) for pose in poses]
    linkages = [linkage_from_text(text, 'points') for text in texts]
    cases: dict[str, Any] = {'klann': {'text': TEXTS['klann'], 'cases': []}}
    for n, linkage in enumerate(linkages):
        case = {'numbers': linkage.numbers, 'alphas': alphas.tolist()}
        cases[str(n)] = {'text': texts[n], 'cases': [case]}
    answers = in_node(POSES, cases)
    compared = 0
    for n, (pose, linkage) in enumerate(zip(poses, linkages, strict=True)):
        (answer,) = answers[str(n)]
        expected = linkage_poses(pose.linkage, alphas, points=True, transmission_angles=True)
        sines: Any = np.abs(np.sin(expected.transmission_angles)).min(axis=1)
        order = [linkage.structure.points.index(name) for name in pose.linkage.structure.points]
        for k in np.flatnonzero(sines > 1e-3):
            points = np.array(answer[k]['points'])[order]
            difference = np.abs(points - expected.points[k]).max()
            assert difference * sines[k] < 1e-11 * pose.linkage.size
            compared += 1
    assert compared > 300


def test_what_python_refuses_is_refused_in_a_line() -> None:
    texts = []
    for name, rows in FILES['refused'].items():
        texts += [FILES[name].replace(old, new, 1) for old, new, _ in rows]
    for text, answer in zip(texts, read_in_node(texts), strict=True):
        for line in answer['refused']:
            assert '\n' not in line
            assert 5 < len(line) < 500, text


def test_at_a_dead_point_the_assembly_is_stated() -> None:
    in_line = FILES['four-bar'].replace('  C: [80, 50]', '  C: [50, 6.25]')
    script = READ.replace("linkageText(linkage, content, poseAt(linkage, start).x, 'saved')", "''")
    texts = [in_line, *(f'{in_line}assembly: [{sign}]\n' for sign in (1, -1, '1, 1'))]
    bare, plus, minus, many = in_node(script, {'texts': texts, 'klann': TEXTS['klann']})
    assert 'at a dead point of coupler, rocker' in bare['refused'][0]
    assert plus['signs'] == [1]
    assert minus['signs'] == [-1]
    assert 'at a dead point' in many['refused'][0]


def test_a_change_point_is_left_as_the_assembly_states() -> None:
    cases = {}
    for sign in ('1', '-1'):
        text = f'{FILES["parallelogram"]}assembly: [{sign}]\n'
        numbers = linkage_from_text(text, 'points').numbers
        cases[sign] = {'text': text, 'cases': [{'numbers': numbers, 'alphas': [0.3, 1.0]}]}
    answers = in_node(POSES, {'klann': {'text': TEXTS['klann'], 'cases': []}, **cases})
    for sign, case in cases.items():
        expected = linkage_poses(linkage_from_text(case['text'], sign), [0.3, 1.0], points=True)
        points = [pose['points'] for pose in answers[sign][0]]
        np.testing.assert_allclose(points, expected.points, rtol=0, atol=1e-9)
