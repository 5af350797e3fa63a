"""The shipped linkages against numbers that others have published, within their reading errors."""

from collections import Counter

from klann_ros.kinematics import shipped_linkage, shipped_linkages
from published_linkages import CITED, Cited, SOURCES, TABLES, tables, WITHOUT
import pytest


@pytest.mark.parametrize('cited', CITED, ids=str)
def test_ours_is_within_the_reading_error(cited: Cited) -> None:
    assert cited.deviation <= cited.error, cited.ours


def test_every_shipped_linkage_is_cited_or_has_a_reason() -> None:
    cited = {number.linkage for number in CITED}
    assert not cited & set(WITHOUT)
    assert cited | set(WITHOUT) == set(shipped_linkages())
    assert len(cited) >= 12
    assert sum(len(number.values) for number in CITED) >= 40


@pytest.mark.parametrize('name', shipped_linkages())
def test_every_shipped_linkage_has_a_source(name: str) -> None:
    assert shipped_linkage(name).source.strip()


def test_no_number_is_cited_twice() -> None:
    ((_, count),) = Counter(map(str, CITED)).most_common(1)
    assert count == 1


def test_every_source_is_cited_and_has_an_error() -> None:
    assert {number.source for number in CITED} == set(SOURCES)
    assert all(source.title and source.at and source.exact for source in SOURCES.values())


def test_the_tables_are_generated_from_the_numbers() -> None:
    assert TABLES.read_text(encoding='utf-8') == tables(), (
        'write it: python test/support/published_linkages.py'
    )
