"""
Settings of Sphinx, for `python docs/build.py FOLDER` and for rosdoc2, which adds its own.

rosdoc2 keeps the places of the files (rosdoc2.yaml): README and the like above docs/.
"""

from importlib.util import find_spec
from pathlib import Path
import re
import sys

from klann_ros import __version__

DOCS = Path(__file__).resolve().parent
sys.path.insert(0, str(DOCS))
# Where the Markdown itself is shown, a link stands for a generated file.
GENERATED = re.compile(r'(?ms)^<!-- generated (\S+) -->\n.*?^<!-- end -->\n')

project = 'klann_ros'
author = 'klann_ros maintainers'
version = release = __version__
extensions = ['myst_parser', 'sphinx.ext.autodoc', 'sphinx.ext.napoleon']
source_suffix = {'.rst': 'restructuredtext', '.md': 'markdown'}
myst_enable_extensions = ['dollarmath', 'amsmath']
# Links to a heading, as where the Markdown itself is shown.
myst_heading_anchors = 3
# A name in single backticks is code, in docstrings and CHANGELOG.rst.
default_role = 'code'
autodoc_member_order = 'bysource'
autodoc_typehints = 'description'
autodoc_typehints_description_target = 'documented_params'
napoleon_google_docstring = False
napoleon_use_ivar = True
# Code of kinds that have no lexer is shown as it is; and a parameter's type may be prose ('of the
# shape of alpha'), whose words are no names of ours.
suppress_warnings = ['misc.highlighting_failure', 'ref.python']

html_title = 'klann_ros'
html_copy_source = False
html_show_copyright = False
# They would be fetched, which a browser refuses for files.
html_show_search_summary = False
if find_spec('furo'):
    extensions += ['sphinx.ext.githubpages', 'static_site']
    html_theme = 'furo'
    html_math_renderer = 'mathml'
    html_static_path = ['static']
    templates_path = ['templates']
    html_additional_pages = {'index': 'start.html'}
else:
    # docs.ros.org has a theme of its own, and an older docutils.
    extensions += ['sphinx.ext.mathjax']


def include_generated(_app, _page, source):
    """Put generated files into a page, in place of the links to them."""
    source[0] = GENERATED.sub(lambda match: (DOCS / match[1]).read_text('utf-8'), source[0])


def setup(app):
    """Extend Sphinx."""
    app.connect('source-read', include_generated)
