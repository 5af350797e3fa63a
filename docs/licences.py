"""
Write the licences of all dependencies into licences.md: python docs/licences.py.

The table has what the installed packages state of themselves, without the wheels of ROS. Packages
of another Python stay in it.
"""

from importlib import metadata
from pathlib import Path
import re
import sys

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

PAGE = Path(__file__).with_name('licences.md')
TABLE = re.compile(r'(?<=\| licence \| packages \|\n\|---\|---\|\n)(?:\|.*\n)*')
ROOT = Requirement('klann_ros[all,cluster]')
# Identifiers of SPDX for the words of older metadata; "BSD" is a name of several.
SPDX = {
    '3-Clause BSD License': 'BSD-3-Clause',
    'Apache 2': 'Apache-2.0',
    'Apache 2.0': 'Apache-2.0',
    'Apache Software License': 'Apache-2.0',
    'BSD License': 'BSD',
    'MIT License': 'MIT',
    'Mozilla Public License 2.0 (MPL 2.0)': 'MPL-2.0',
    'Python Software Foundation License': 'PSF-2.0',
}
# Their licences are files only, or, for older ones of dateutil, a choice of two.
UNSTATED = {'graphemeu': 'MIT', 'python-dateutil': 'BSD-3-Clause', 'setuptools': 'MIT'}
# A longer statement is the text of the licence.
MAX_NAME_LENGTH = 60


def dependencies() -> dict[str, metadata.Distribution]:
    """Return the installed distributions that the extras of klann_ros need, without ROS."""
    pending = [ROOT]
    visited = set()
    distributions = {}
    while pending:
        requirement = pending.pop()
        name = canonicalize_name(requirement.name)
        extras = frozenset(requirement.extras)
        if (name, extras) in visited or name.startswith('ros-'):
            continue
        visited.add((name, extras))
        try:
            distribution = metadata.distribution(name)
        except metadata.PackageNotFoundError:
            continue
        distributions[name] = distribution
        for line in distribution.requires or ():
            dependency = Requirement(line)
            environments = [{'extra': extra} for extra in ('', *extras)]
            marker = dependency.marker
            if marker is None or any(map(marker.evaluate, environments)):
                pending.append(dependency)
    del distributions[canonicalize_name(ROOT.name)]
    return distributions


def licence(name: str, distribution: metadata.Distribution) -> str:
    """Return the licence that a distribution states, as SPDX writes it."""
    if name in UNSTATED:
        return UNSTATED[name]
    statements = [distribution.metadata[key] for key in ('License-Expression', 'License')]
    for classifier in distribution.metadata.get_all('Classifier') or ():
        if classifier.startswith('License :: '):
            statements.append(classifier.split(' :: ')[-1])
    for statement in filter(None, statements):
        if len(statement) < MAX_NAME_LENGTH:
            return SPDX.get(statement, statement)
    return 'not stated'


def rows(page: str) -> dict[str, set[str]]:
    """Return the packages of each licence on the page."""
    match = TABLE.search(page)
    packages = {}
    for line in match[0].splitlines() if match else ():
        _, licence_cell, package_cell, _ = line.split('|')
        packages[licence_cell.strip()] = set(package_cell.strip().split(', '))
    return packages


def main() -> None:
    """Write the table."""
    page = PAGE.read_text(encoding='utf-8')
    packages = rows(page)
    for name, distribution in dependencies().items():
        packages.setdefault(licence(name, distribution), set()).add(name)
    lines = [f'| {text} | {", ".join(sorted(packages[text]))} |\n' for text in sorted(packages)]
    PAGE.write_text(TABLE.sub(''.join(lines), page), encoding='utf-8')


if __name__ == '__main__':
    sys.exit(main())
