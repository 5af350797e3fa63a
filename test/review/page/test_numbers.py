"""The numbers of the page are those recorded, to the stated precision; no peak is lost."""

from base64 import b64decode
import json
import math

from hypothesis import given, strategies as st
from klann_ros.kinematics import LinkageLeg, shipped_linkage, shipped_linkages
from klann_ros.review.page.data import (
    A_DECADE,
    FIRST,
    histogram,
    pack_angles,
    pack_times,
    pack_turns,
    thin_rows,
)
from klann_ros.web.markup import element, joined, Markup
from klann_ros.web.parts import as_script
from klann_ros.web.shape import leg_shape
import numpy as np
import pytest

any_float = st.floats(width=64)


def unpacked(column: dict) -> np.ndarray:
    kind = {'f32': '<f4', 'i32': '<i4'}[column['kind']]
    numbers = np.frombuffer(b64decode(column['data']), kind).astype(float)
    if column['kind'] == 'i32':
        numbers = np.where(numbers == -(2**31), np.nan, numbers * column['scale'])
    return numbers


@given(st.lists(st.floats(-1e9, 1e9), min_size=1))
def test_an_angle_is_its_turns_and_its_part_of_one_more(angles: list[float]) -> None:
    radians = np.array(angles)
    turns = unpacked(pack_turns(radians))
    again = unpacked(pack_angles(radians)) + math.tau * turns
    assert again == pytest.approx(radians, rel=1e-15, abs=2e-9)


@given(st.lists(any_float, min_size=1))
def test_invalid_angles_are_null(angles: list[float]) -> None:
    radians = np.array(angles)
    is_packed = np.isfinite(unpacked(pack_angles(radians)))
    assert (is_packed == (np.abs(radians) / math.tau <= 2**31 - 1)).all()


@given(st.lists(st.floats(0.0, 1e5), min_size=1))
def test_times_are_known_to_a_microsecond_or_their_last_digit(times: list[float]) -> None:
    seconds = np.array(times)
    allowed = max(0.51e-6, 0.51 * seconds.max() / (2**31 - 1))
    assert np.abs(unpacked(pack_times(seconds)) - seconds).max() <= allowed


@given(
    st.lists(st.floats(allow_infinity=False), min_size=1, max_size=400),
    st.integers(4, 100),
    st.data(),
)
def test_the_greatest_and_the_least_are_kept(
    numbers: list[float], max_count: int, data: st.DataObject
) -> None:
    column = np.array(numbers)
    needed = data.draw(st.lists(st.integers(0, len(numbers) - 1), max_size=3))
    rows = thin_rows(len(column), [column], max_count, needed)
    assert (np.diff(rows) > 0).all()
    assert {0, len(column) - 1, *needed} <= set(rows.tolist())
    assert len(rows) <= max(max_count, 4) + 4 + len(needed)
    if not np.isnan(column).all():
        assert np.nanmax(column[rows]) == np.nanmax(column)
        assert np.nanmin(column[rows]) == np.nanmin(column)


def test_every_stretch_keeps_its_peak() -> None:
    column = np.zeros(100_000)
    column[5_003::10_000] = 1.0
    rows = thin_rows(len(column), [column], 1000)
    assert len(rows) <= 1010
    assert column[rows].sum() == 10


def point_positions(shape: dict, phases: np.ndarray) -> np.ndarray:
    """Return the points as the page's script has them."""
    u = np.exp(1j * np.array(shape['senses']) * phases)
    for j, frame in enumerate(shape['frames']):
        if frame is not None:
            u[j] = phases[j] * (1.0 if frame < 0 else u[frame])
    positions = []
    for point in shape['points']:
        position = complex(*point['at'])
        for j, re, im in point['terms']:
            position += complex(re, im) * u[j]
        positions.append((position.real, position.imag))
    return np.array(positions)


@pytest.mark.parametrize('name', shipped_linkages())
def test_any_linkage_has_its_points(name: str) -> None:
    leg = LinkageLeg(shipped_linkage(name))
    pose = leg.solve(leg.linkage.start[0] + 0.1)
    shape = leg_shape(leg)
    assert point_positions(shape, np.array(pose.joints)) == pytest.approx(pose.points, abs=1e-12)
    assert [point['name'] for point in shape['points']][leg.linkage.foot] == shape['foot']


@given(st.lists(st.floats(-1.0, 1e6)))
def test_a_histogram_counts_everything_once(times: list[float]) -> None:
    seconds = np.array(times)
    assert sum(histogram(seconds)['counts']) == np.count_nonzero(seconds >= 1e-6)


def test_a_histogram_names_times_and_their_bin() -> None:
    bins = histogram(np.array([0.005] * 9 + [0.4]))
    begin = 10 ** (FIRST + bins['first'] / A_DECADE)
    assert begin <= 0.005 < begin * 10 ** (1 / A_DECADE)
    assert bins['counts'][0] == 9
    assert bins['text'].startswith('Half of 10 are up to 5 ms')
    assert 'the longest is 400 ms' in bins['text']


@given(st.text())
def test_no_text_can_end_the_script_it_stands_in(text: str) -> None:
    script = as_script([{text: text}])
    assert '<' not in script
    assert json.loads(script) == [{text: text}]


@given(st.text())
def test_texts_are_escaped_and_markup_is_not(text: str) -> None:
    markup = element('p', text, element('b', 'x'), title=text, aria_label='y', hidden=False)
    inner = markup.removesuffix('<b>x</b></p>').removeprefix('<p title="')
    assert '<' not in inner.replace('">', '', 1).replace('" aria-label="y', '')
    assert isinstance(joined([markup, text]), Markup)
