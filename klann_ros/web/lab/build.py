"""The lab as one HTML file that opens offline; `python -m klann_ros.web.lab.build` writes it."""

from pathlib import Path
from string import Template

from klann_ros.kinematics.linkage.file import SHIPPED, shipped_linkages
from klann_ros.web.markup import element
from klann_ros.web.parts import as_script, FRAME, Parts, SHARED, text

_FOLDER = Path(__file__).resolve().parent
_STATIC_FILES = _FOLDER / 'static'

FILE = _FOLDER / 'lab.html'
"""The page as it is installed; it is under version control, so that no build step makes it."""

_JS_YAML = SHARED / 'js_yaml'

SOLVER = (
    _JS_YAML / 'js-yaml.min.js',
    *(
        _STATIC_FILES / f'{name}.js'
        for name in (
            'complex',
            'structure',
            'order',
            'linkage',
            'dyads',
            'blocks',
            'solve',
            'branch',
            'assemblies',
            'reach',
            'yaml',
            'yaml_text',
            'schema',
            'file',
            'parameters',
        )
    ),
)
"""What needs no browser: any linkage, solved as the kinematics does."""

LAB_PARTS = Parts(
    is_compact=True,
    styles=(
        *FRAME,
        SHARED / 'drawing.css',
        SHARED / 'tables.css',
        _STATIC_FILES / 'lab.css',
    ),
    # In this order: each uses what stands above it.
    scripts=(
        SHARED / 'theme.js',
        SHARED / 'drawing.js',
        *SOLVER,
        _STATIC_FILES / 'texts.js',
        _STATIC_FILES / 'dragging.js',
        _STATIC_FILES / 'link.js',
        _STATIC_FILES / 'model.js',
        _STATIC_FILES / 'scene.js',
        _STATIC_FILES / 'panels.js',
        _STATIC_FILES / 'turn_chart.js',
        _STATIC_FILES / 'decimal_field.js',
        _STATIC_FILES / 'numbers.js',
        _STATIC_FILES / 'newton.js',
        _STATIC_FILES / 'path_drawing.js',
        _STATIC_FILES / 'lab.js',
    ),
)


def lab_page() -> str:
    """Return the page."""
    shipped = {name: text(Path(str(SHIPPED), f'{name}.yaml')) for name in shipped_linkages()}
    return Template(text(_STATIC_FILES / 'lab.html')).substitute(
        policy=LAB_PARTS.policy(),
        licence=text(_JS_YAML / 'LICENSE').strip(),
        styles=LAB_PARTS.style_elements(),
        data=element('script', as_script(shipped), id='data', type='application/json'),
        scripts=LAB_PARTS.script_elements(),
    )


if __name__ == '__main__':
    FILE.write_text(lab_page(), encoding='utf-8')
