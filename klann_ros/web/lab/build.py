"""The lab as one HTML file that opens offline; `python -m klann_ros.exercises.lab` writes it."""

from base64 import b85encode
from collections.abc import Mapping
import json
from pathlib import Path
import re
from string import Template
from typing import Any
import zlib

from klann_ros.kinematics import SHIPPED, shipped_linkages
from klann_ros.sanitize.quantity import unit_table
from klann_ros.web.markup import element, Markup
from klann_ros.web.parts import as_script, compact, FRAME, Parts, SHARED, text

_FOLDER = Path(__file__).resolve().parent
_STATIC_FILES = _FOLDER / 'static'

LAB_FILE = _FOLDER / 'lab.html'
"""The page as it is installed; it is under version control, so that no build step makes it."""

_JS_YAML = SHARED / 'js_yaml'


def _scripts(folder: Path, names: str) -> tuple[Path, ...]:
    return tuple(folder / f'{name}.js' for name in names.split())


SOLVER = (
    _JS_YAML / 'js-yaml.min.js',
    *_scripts(_STATIC_FILES, 'complex structure order linkage dyads blocks solve branch changes'),
    *_scripts(
        _STATIC_FILES,
        'assemblies reach motion quantities yaml yaml_text schema points file parameters',
    ),
)
"""What needs no browser: any linkage, solved as the kinematics does."""

QUANTITY = _scripts(_STATIC_FILES, 'units')
"""The reader of numbers with units, by the table of units that the page has."""

_STYLES = (SHARED / 'drawing.css', SHARED / 'tables.css')
COMMENT = re.compile(r'^ *#.*\n| +#.*$', re.MULTILINE)
# Two blanks a level, and content in brackets without quotation marks.
INDENTATION = re.compile(r'^ +', re.MULTILINE)
FLOW = re.compile(r"""[\[{][^"'\n]*$""", re.MULTILINE)
LAB_PARTS = Parts(
    is_compact=True,
    # It has no findings.
    styles=(*FRAME[:-1], *_STYLES, _STATIC_FILES / 'lab.css'),
    # In this order: each uses what stands above it.
    scripts=(
        SHARED / 'drawing.js',
        *SOLVER,
        *QUANTITY,
        *_scripts(_STATIC_FILES, 'texts dragging link model scene panels'),
        *_scripts(_STATIC_FILES, 'courses decimal_field curves values'),
        *_scripts(_STATIC_FILES, 'numbers newton path_drawing'),
        *_scripts(_STATIC_FILES, 'open_practice lab'),
    ),
)

PRACTICE = _scripts(
    _STATIC_FILES / 'practice',
    'expression calculation exercise marking notation figure practice',
)
"""The practice mode, behind `QUANTITY`; all but the last three files need no browser."""


def lab_page(exercises: Mapping[str, Any]) -> str:
    """Return the page, with the data of the exercises."""
    # The names of the exercises' scripts are their own.
    late = ''.join(compact(text(path)) for path in PRACTICE)
    script = f"(() => {{'use strict';{late}}})();"
    style = compact(text(_STATIC_FILES / 'practice.css'))
    practice = {'data': exercises, 'script': script, 'style': style}
    files = {name: text(Path(str(SHIPPED), f'{name}.yaml')) for name in shipped_linkages()}
    shipped = {name: _compact_yaml(file) for name, file in files.items()}
    template = re.sub(r'^ +', '', text(_STATIC_FILES / 'lab.html'), flags=re.MULTILINE)
    return Template(template).substitute(
        policy=LAB_PARTS.policy([script], [style]),
        licence=text(_JS_YAML / 'LICENSE').strip(),
        styles=LAB_PARTS.style_elements(),
        data=element('script', as_script(shipped), id='data', type='application/json'),
        units=element('script', as_script(unit_table()), id='units', type='application/json'),
        packed=element('script', Markup(_deflated(practice)), id='packed', type='text/plain'),
        scripts=LAB_PARTS.script_elements(),
    )


def _compact_yaml(file: str) -> str:
    """Return a linkage's file without comments and needless blanks."""
    indented = INDENTATION.sub(lambda match: match[0][::2], COMMENT.sub('', file))
    return FLOW.sub(lambda match: match[0].replace(', ', ','), indented.replace('\n   -', '\n  -'))


def _deflated(content: object) -> str:
    written = json.dumps(content, ensure_ascii=False, separators=(',', ':'))
    # Base 85 is a sixteenth shorter than base 64; a tag begins with <, and no text shall.
    return b85encode(zlib.compress(written.encode(), 9)).decode('ascii').replace('<', '.')
