"""
Settings of Sphinx, for `python docs/build.py FOLDER` and for rosdoc2, which adds its own.

rosdoc2 keeps the places of the files (rosdoc2.yaml): README and the like above docs/.
"""

from klann_ros import __version__

project = 'klann_ros'
author = 'klann_ros maintainers'
version = release = __version__
extensions = ['myst_parser', 'sphinx.ext.autodoc', 'sphinx.ext.mathjax', 'sphinx.ext.napoleon']
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
