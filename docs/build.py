"""
Build the manual and the API reference: python docs/build.py FOLDER.

Any warning is an error. README, CONTRIBUTING, SECURITY and CHANGELOG are pages of it, so Sphinx
starts from the folder above this one.
"""

from pathlib import Path
import sys

from sphinx.cmd.build import main

DOCS = Path(__file__).resolve().parent
PAGES = ('README.md', 'CONTRIBUTING.md', 'SECURITY.md', 'CHANGELOG.rst', 'docs/**')

if __name__ == '__main__':
    options = ['-b', 'html', '-c', DOCS, '--fail-on-warning', '--quiet']
    options += ['-D', 'root_doc=docs/index', '-D', f'include_patterns={",".join(PAGES)}']
    sys.exit(main([str(argument) for argument in [*options, DOCS.parent, *sys.argv[1:]]]))
