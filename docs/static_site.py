"""
The manual as a site of static files, which needs nothing from outside: an extension of Sphinx.

Formulas are MathML, which browsers draw themselves. The lab is a file beside the pages.
"""

from pathlib import Path
import re
import shutil
from typing import Any

from docutils import nodes
from docutils.transforms import Transform
from docutils.utils.math.latex2mathml import tex2mathml
from klann_ros.web import LAB_FILE
from sphinx.addnodes import download_reference
from sphinx.application import Sphinx

# Pages in Portuguese, and the English pages that say the same.
PORTUGUESE = {'docs/teoria': 'docs/theory'}
ENGLISH = {english: portuguese for portuguese, english in PORTUGUESE.items()}

# What a page may load: files of the site.
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; font-src 'self'; "
    "img-src 'self' data:; base-uri 'none'; form-action 'self'"
)
SPACED_FUNCTION = re.compile(r'(<mo>&ApplyFunction;</mo>)(?=\s*<m(?:i|n|sub|sup|frac|sqrt)\b)')
DESCRIPTION = 'Leg linkages: kinematics, a lab in the browser, simulation and ROS 2 nodes'
PICTURE = 'klann_ros.png'


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


def show_formula(translator: Any, node: nodes.Element) -> None:
    """Write a formula of a line or a paragraph as MathML."""
    is_block = isinstance(node, nodes.math_block)
    formula = tex2mathml(node.astext(), as_block=is_block)
    # As TeX has it, between a function and its argument without parentheses.
    formula = SPACED_FUNCTION.sub(r'\1<mspace width="0.17em"></mspace>', formula)
    translator.body.append(f'<div class="math">{formula}</div>' if is_block else formula)
    raise nodes.SkipNode


def complete_page(
    app: Sphinx, page: str, _template: str, context: dict[str, Any], _doctree: Any
) -> None:
    """Tell a page its language, its translation, what it may load, and its picture."""
    if page in PORTUGUESE:
        context['language'] = 'pt-BR'
        context['translation'] = (PORTUGUESE[page], 'en', 'English')
    elif page in ENGLISH:
        context['translation'] = (ENGLISH[page], 'pt-BR', 'Português')
    tags = [f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">']
    tags.append(f'<meta name="description" content="{DESCRIPTION}">')
    # Networks that show a picture beside a link take absolute addresses only.
    if app.config.html_baseurl:
        url = app.config.html_baseurl.rstrip('/')
        tags += [
            f'<meta property="og:{name}" content="{content}">'
            for name, content in (
                ('type', 'website'),
                ('title', context.get('title') or app.config.html_title),
                ('description', DESCRIPTION),
                ('image', f'{url}/_static/{PICTURE}'),
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
    app.connect('html-page-context', complete_page)
    app.connect('build-finished', copy_lab)
    return {'parallel_read_safe': True, 'parallel_write_safe': True}
