"""
Build the manual, the API reference and the lab as one folder: python docs/build.py FOLDER.

The folder is a site of static files: any web server can serve it, below any address, and a
browser opens it from a disk. Any warning is an error, and so is a broken link, or a page that
loads something from outside. README, CONTRIBUTING, SECURITY and CHANGELOG are pages, so Sphinx
starts from the folder above this one.
"""

import argparse
import gc
from pathlib import Path
import sys
from tempfile import TemporaryDirectory

from links import Site
from sphinx.cmd.build import main

DOCS = Path(__file__).resolve().parent
PAGES = ('README.md', 'CONTRIBUTING.md', 'SECURITY.md', 'CHANGELOG.rst', 'docs/**')


def build(folder: Path, url: str) -> int:
    """Build the site that will stand at an address, if there is one; return 0 on success."""
    # A quarter of the time would go to looking for garbage among nodes that stay to the end.
    gc.disable()
    with TemporaryDirectory(prefix='klann_ros-docs-') as doctrees:
        options = ['-b', 'html', '-c', DOCS, '-d', doctrees, '--fail-on-warning', '--quiet']
        options += ['-D', 'root_doc=docs/index', '-D', f'include_patterns={",".join(PAGES)}']
        options += ['-D', f'html_baseurl={url}', DOCS.parent, folder]
        code = main([str(option) for option in options])
    if code:
        return code
    broken = [*Site(folder).broken_links()]
    for line in broken:
        sys.stderr.write(f'{line}\n')
    if broken:
        return 1
    print(f'The site begins with {folder / "index.html"}')
    return 0


if __name__ == '__main__':
    parser = argparse.ArgumentParser(description='Build the manual and the lab as static files.')
    parser.add_argument('folder', type=Path, metavar='FOLDER')
    help_text = 'address of the published site: it names the picture that networks show'
    parser.add_argument('--url', default='', help=help_text)
    arguments = parser.parse_args()
    sys.exit(build(arguments.folder, arguments.url))
