"""The notebooks of the lectures run from end to end and print the numbers of the slides."""

from contextlib import redirect_stdout
from io import StringIO
import json
from pathlib import Path
from typing import Any

import pytest

NOTEBOOKS = sorted((Path(__file__).resolve().parents[2] / 'examples/notebooks').glob('*.ipynb'))
PRINTED = {
    'sem104_lecture_7': ('10.657  67.3283 34.4634 45.722', 'stride 0.4910 m', 'equal: True'),
    'four_bar': (
        'Z 156.20 mm',
        '72.14 deg',
        'theta4 235.20 deg',
        '21.5576',
        'crank-rocker',
        'equal: True',
    ),
}


def cells(path: Path, kind: str) -> list[str]:
    content: dict[str, Any] = json.loads(path.read_text(encoding='utf-8'))
    assert (content['nbformat'], content['nbformat_minor']) == (4, 5)
    return [''.join(cell['source']) for cell in content['cells'] if cell['cell_type'] == kind]


@pytest.mark.parametrize('path', NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_and_prints_the_slides_numbers(path: Path) -> None:
    # When called: it takes long, in each worker that collects this.
    import matplotlib as mpl
    import matplotlib.pyplot as plt

    first, *code = cells(path, 'code')
    assert first.startswith('%pip install')
    mpl.use('Agg')
    printed = StringIO()
    names: dict[str, Any] = {}
    # A few frames of a movement are enough [MB].
    with redirect_stdout(printed), mpl.rc_context({'animation.embed_limit': 0.1}):
        for source in code:
            exec(compile(source, path.name, 'exec'), names)  # noqa: S102 - our own
        assert '<script' in names['movement'].to_jshtml()
    plt.close('all')
    assert [text for text in PRINTED[path.stem] if text not in printed.getvalue()] == []


@pytest.mark.parametrize('path', NOTEBOOKS, ids=lambda path: path.stem)
def test_every_heading_has_both_languages(path: Path) -> None:
    texts = cells(path, 'markdown')
    assert sum('**PT**' in text and '**EN**' in text for text in texts) >= len(texts) - 1
