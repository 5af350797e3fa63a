"""The page of licences names every package that klann_ros needs, by the licence that it states."""

import runpy
from types import SimpleNamespace

import pytest
from source import ROOT


@pytest.fixture
def licences() -> SimpleNamespace:
    return SimpleNamespace(**runpy.run_path(str(ROOT / 'docs' / 'licences.py')))


def test_the_page_names_each_installed_dependency_by_its_licence(
    licences: SimpleNamespace,
) -> None:
    rows = licences.rows(licences.PAGE.read_text(encoding='utf-8'))
    dependencies = licences.dependencies()
    assert {'numpy', 'pymoo', 'moocore'} <= set(dependencies)
    for name, distribution in dependencies.items():
        assert name in rows.get(licences.licence(name, distribution), ()), name
