"""The notebooks of the lectures run from end to end, offline, and print the slides' numbers."""

from contextlib import redirect_stdout
import importlib.util
from io import StringIO
import json
from pathlib import Path
import re
from typing import Any

import klann_ros
import pytest

NOTEBOOKS = sorted((Path(__file__).resolve().parents[2] / 'examples/notebooks').glob('*.ipynb'))
KLANN = ('10.657  67.3283 34.4634 45.722', ' 0.4910 m', ': True', 'L_AB = 115')
FOUR_BAR = ('Z 156.20 mm', '72.14', 'theta4 235.20', '21.5576', 'crank-rocker', ': True')
# What a notebook prints, and the labels of its axes along the plane.
PRINTED = {
    'sem104_lecture_7': ('stride', *KLANN),
    'sem104_aula_7': ('passada', *KLANN),
    'four_bar': ('72.14 deg', *FOUR_BAR),
    'quatro_barras': ('72.14 graus', *FOUR_BAR),
}
UNITS = {'sem104_lecture_7': 'm', 'sem104_aula_7': 'm', 'four_bar': 'mm', 'quatro_barras': 'mm'}


def code_cells(path: Path) -> list[str]:
    content: dict[str, Any] = json.loads(path.read_text(encoding='utf-8'))
    assert (content['nbformat'], content['nbformat_minor']) == (4, 5)
    return [''.join(cell['source']) for cell in content['cells'] if cell['cell_type'] == 'code']


@pytest.mark.slow
@pytest.mark.parametrize('path', NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_offline_and_prints_the_slides_numbers(path: Path) -> None:
    # When called: it takes long, in each worker that collects this.
    import matplotlib as mpl
    import matplotlib.pyplot as plt

    mpl.use('Agg')
    printed = StringIO()
    names: dict[str, Any] = {}
    # A few frames of a movement are enough [MB].
    with redirect_stdout(printed), mpl.rc_context({'animation.embed_limit': 0.1}):
        for cell in code_cells(path):
            source = cell.replace('%pip', 'raise ConnectionError #')
            exec(compile(source, path.name, 'exec'), names)  # noqa: S102 - our own
        assert '<script' in names['movement'].to_jshtml()
    axes = [plt.figure(number).axes[0] for number in plt.get_fignums()]
    plt.close('all')
    assert [text for text in PRINTED[path.stem] if text not in printed.getvalue()] == []
    planes = {ax.get_ylabel() for ax in axes if ax.get_xlabel().startswith('x')}
    assert planes == {f'y / {UNITS[path.stem]}'}


@pytest.mark.parametrize('path', NOTEBOOKS, ids=lambda path: path.stem)
def test_without_the_package_this_release_is_installed_or_a_line_says_what_to_do(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = code_cells(path)[0]
    (requirement,) = re.findall(r'matplotlib "(.*)"', source)
    assert requirement.startswith('klann_ros @ git+https://')
    assert requirement.endswith(f'/klann_ros@{klann_ros.__version__}')
    namespace = importlib.util.spec_from_loader('klann_ros', loader=None)
    for spec in (None, namespace):
        monkeypatch.setattr(importlib.util, 'find_spec', lambda _, spec=spec: spec)
        with pytest.raises(SystemExit, match=r'^[^\n]* 0\.[^\n]*: pip install \. matplotlib$'):
            exec(source.replace('%pip', 'pass #'), {})  # noqa: S102 - our own
