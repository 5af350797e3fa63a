"""
The search for legs that fulfil requirements; each one found is proven to turn.

>>> from klann_ros.design import requirements_from, search
>>> figures = {'stride': 'maximize', 'lift': 'maximize'}
>>> requirements = requirements_from({'linkage': 'klann', 'figures': figures})
>>> found = search(requirements, evaluations=2000)
>>> found.legs[0].reached['stride'] > 0.49  # [m], SEM 104's
True

All values are in SI units. A figure is the one that `klann_ros.datasheet` reports.
"""

from .proof import FoundLeg
from .requirements import Aim, Limit, Requirements, requirements_from, requirements_from_file
from .search import Progress, search, SearchResult, State
from .space import RequirementsError, Space

__all__ = [
    'Aim',
    'FoundLeg',
    'Limit',
    'Progress',
    'Requirements',
    'RequirementsError',
    'SearchResult',
    'Space',
    'State',
    'requirements_from',
    'requirements_from_file',
    'search',
]
