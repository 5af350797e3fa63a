"""
The manual as a site of static files, which needs nothing from outside: an extension of Sphinx.

Formulas are MathML, which browsers draw themselves. The lab is a file beside the pages. Images
with the names of interactive/figures.yaml become figures that the reader turns, by the lab's
solver.
"""

from html import escape, unescape
from pathlib import Path
import re
import shutil
from typing import Any

from docutils import nodes
from docutils.transforms import Transform
from docutils.utils.math.latex2mathml import tex2mathml
from klann_ros.kinematics import SHIPPED
from klann_ros.web import LAB_FILE, SHARED
from klann_ros.web.lab.build import SOLVER
from klann_ros.web.parts import as_script, compact, text
from sphinx.addnodes import download_reference
from sphinx.application import Sphinx
import yaml

INTERACTIVE = Path(__file__).resolve().parent / 'interactive'
LAB_STATIC = SOLVER[-1].parent
YAML_SCRIPTS = {'js-yaml.min', 'yaml', 'yaml_text', 'parameters'}
# In this order: each uses what stands before it. Linkages are data here, and are not read as YAML.
FIGURE_SCRIPTS = (
    *(SHARED / f'{name}.js' for name in ('theme', 'drawing')),
    *(path for path in SOLVER if path.stem not in YAML_SCRIPTS),
    *(LAB_STATIC / f'{name}.js' for name in ('texts', 'dragging')),
    *(INTERACTIVE / f'{name}.js' for name in ('layers', 'charts', 'values', 'figure')),
)
DARK_THEME = re.compile(
    r'@media screen and \(prefers-color-scheme: dark\) \{\s*:root (\{.*?\})\s*\}', re.DOTALL
)
# The reader's choice of the page's theme goes before the system's.
DARK_FIGURES = r"""@media screen { body[data-theme='dark'] .interactive \1 }
@media screen and (prefers-color-scheme: dark) {
  body:not([data-theme='light']) .interactive \1
}"""
PLANS = yaml.safe_load(text(INTERACTIVE / 'figures.yaml'))
FIGURE_IMAGE = re.compile(rf'<img [^>]*/({"|".join(PLANS)})\.png"')

# A page in Portuguese links to the English page that says the same.
ENGLISH_LINK = re.compile(r'In English:\s+\[[^\]]*\]\((\w+)\.md\)')

# What a page may load: files of the site.
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; font-src 'self'; "
    "img-src 'self' data:; base-uri 'none'; form-action 'self'"
)
THIN_SPACE = '<mspace width="0.17em"></mspace>'
# Upright letters, spaces that TeX has around a function, and operators that begin or end a group.
MATHML_DETAILS = (
    (r'<mi class="capital-greek">', '<mi mathvariant="normal">'),
    (r'(<mo>&ApplyFunction;</mo>)(?=\s*<m(?:i|n|sub|sup|frac|sqrt)\b)', r'\1' + THIN_SPACE),
    (r'(</m(?:i|n|sub|sup|subsup)>)(?=\s*<mi>\w+</mi>\s*<mo>&Apply)', r'\1' + THIN_SPACE),
    (r'(<mo[^>]*>[(\[,=]</mo>\s*)<mo>([±\u2212+])</mo>', r'\1<mo form="prefix">\2</mo>'),
    (
        r'<mo[^>]*>\|</mo>(.*?)<mo[^>]*>\|</mo>',
        r'<mo form="prefix" stretchy="false">|</mo>\1<mo form="postfix" stretchy="false">|</mo>',
    ),
)
DESCRIPTION = 'Leg linkages: kinematics, a lab in the browser, simulation and ROS 2 nodes'
PICTURE = 'klann_ros.png'
START = 'start.html'


def english_pages() -> dict[str, str]:
    """Return the English page of each page in Portuguese."""
    pages = {}
    for path in INTERACTIVE.parent.glob('*.md'):
        link = ENGLISH_LINK.search(text(path))
        if link:
            pages[f'docs/{path.stem}'] = f'docs/{link[1]}'
    return pages


PORTUGUESE = english_pages()
ENGLISH = {english: portuguese for portuguese, english in PORTUGUESE.items()}


class LabLink(Transform):
    """Let links to the lab's file lead to its copy in the site."""

    default_priority = 999

    def apply(self, **_: Any) -> None:
        """Replace what would be a download."""
        for node in list(self.document.findall(download_reference)):
            if node['reftarget'].endswith(LAB_FILE.name):
                depth = self.document.settings.env.docname.count('/')
                link = nodes.reference('', '', refuri='../' * depth + LAB_FILE.name)
                link += node.children
                node.replace_self(link)


def formula_markup(formula: str, *, is_block: bool = False) -> str:
    """Return a formula of TeX as MathML."""
    markup = tex2mathml(formula, as_block=is_block)
    for pattern, replacement in MATHML_DETAILS:
        markup = re.sub(pattern, replacement, markup, flags=re.DOTALL)
    return f'<div class="math">{markup}</div>' if is_block else markup


def show_formula(translator: Any, node: nodes.Element) -> None:
    """Write a formula of a line or a paragraph."""
    is_block = isinstance(node, nodes.math_block)
    translator.body.append(formula_markup(node.astext(), is_block=is_block))
    raise nodes.SkipNode


def figures_script() -> str:
    """Return the script of all figures, with the linkages that they name."""
    linkages = {}
    for plan in PLANS.values():
        for choice in plan.get('pick', [plan]):
            name = choice['linkage']
            if isinstance(name, str):
                linkages[name] = yaml.safe_load(text(Path(str(SHIPPED), f'{name}.yaml')))
    scripts = ''.join(compact(text(script)) for script in FIGURE_SCRIPTS)
    constants = f'const FIGURES = {as_script(PLANS)}, LINKAGES = {as_script(linkages)};'
    return f"(() => {{'use strict';{constants}{scripts}makeFigures();}})();"


def figures_style() -> str:
    """Return the styles of the figures, in the reader's choice of light or dark."""
    theme = DARK_THEME.sub(DARK_FIGURES, text(SHARED / 'theme.css'))
    styles = (text(SHARED / 'drawing.css'), text(INTERACTIVE / 'figure.css'))
    return '\n'.join([theme.replace(':root', '.interactive'), *styles])


def write_figures(app: Sphinx) -> None:
    """Write the scripts and styles of the figures."""
    folder = Path(app.outdir, '_static')
    folder.mkdir(parents=True, exist_ok=True)
    (folder / 'figures.js').write_text(figures_script(), encoding='utf-8')
    (folder / 'figures.css').write_text(figures_style(), encoding='utf-8')


def improve_markup(context: dict[str, Any]) -> None:
    """Name what readers of the page by ear meet without a name."""
    body = context.get('body', '')
    context['body'] = body.replace('<th class="head"><p></p></th>', '<td></td>')
    tree = context.get('furo_navigation_tree', '')
    context['furo_navigation_tree'] = tree.replace('"heading"', '"heading" aria-level="2"')


def complete_page(
    app: Sphinx, page: str, template: str, context: dict[str, Any], _doctree: Any
) -> None:
    """Tell a page its language, its translation, what it may load, and its picture."""
    if page in PORTUGUESE:
        context['language'] = 'pt-BR'
        context['translation'] = (PORTUGUESE[page], 'en', 'English')
    elif page in ENGLISH:
        context['translation'] = (ENGLISH[page], 'pt-BR', 'Português')
    if template == START or FIGURE_IMAGE.search(context.get('body', '')):
        app.add_css_file('figures.css')
        app.add_js_file('figures.js', loading_method='defer')
    improve_markup(context)
    tags = [f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">']
    tags.append(f'<meta name="description" content="{DESCRIPTION}">')
    # Networks that show a picture beside a link take absolute addresses only.
    if app.config.html_baseurl:
        url = app.config.html_baseurl.rstrip('/')
        title = context.get('title') or app.config.html_title
        tags += [
            f'<meta property="og:{name}" content="{content}">'
            for name, content in (
                ('type', 'website'),
                ('title', escape(unescape(re.sub(r'<[^>]*>', '', title)))),
                ('description', DESCRIPTION),
                ('image', escape(f'{url}/_static/{PICTURE}')),
                ('image:width', '1200'),
                ('image:height', '630'),
            )
        ]
        tags.append('<meta name="twitter:card" content="summary_large_image">')
    context['metatags'] = context.get('metatags', '') + '\n'.join(tags)


def copy_lab(app: Sphinx, error: Exception | None) -> None:
    """Copy the lab beside the pages."""
    if error is None:
        shutil.copyfile(LAB_FILE, Path(app.outdir, LAB_FILE.name))


def setup(app: Sphinx) -> dict[str, bool]:
    """Extend Sphinx."""
    app.add_html_math_renderer('mathml', (show_formula, None), (show_formula, None))
    app.add_transform(LabLink)
    app.add_css_file('site.css')
    app.add_js_file('page.js', loading_method='defer')
    app.connect('builder-inited', write_figures)
    # After the theme has made its part.
    app.connect('html-page-context', complete_page, priority=900)
    app.connect('build-finished', copy_lab)
    return {'parallel_read_safe': True, 'parallel_write_safe': True}
