"""Notebooks and tables are those of their one source, and both languages of a page agree."""

from pathlib import Path
import runpy

DOCS = Path(__file__).resolve().parents[2] / 'docs'


def test_notebooks_and_tables_are_those_of_their_source() -> None:
    outputs = dict(runpy.run_path(str(DOCS / 'translations.py'))['outputs']())
    outdated = [path.name for path in outputs if path.read_text('utf-8') != outputs[path]]
    assert outdated == [], 'run python docs/translations.py'
    written = {path for path in outputs if path.suffix == '.ipynb'}
    assert written == {*(DOCS.parent / 'examples' / 'notebooks').glob('*.ipynb')}
