"""
The search for legs that fulfil a wish; each one found is proven to turn.

>>> from klann_ros.design import search, wish_from
>>> wish = wish_from({'linkage': 'klann', 'figures': {'stride': 'maximize', 'lift': 'maximize'}})
>>> found = search(wish, evaluations=2000)
>>> found.legs[0].reached['stride'] > 0.49  # [m], SEM 104's
True

All values are in SI units. A figure is the one that `klann_ros.datasheet` reports.
"""

from .proof import FoundLeg
from .search import Found, Progress, search, State
from .space import Space, WishError
from .wish import Aim, Limit, Wish, wish_from, wish_from_file

__all__ = [
    'Aim',
    'Found',
    'FoundLeg',
    'Limit',
    'Progress',
    'Space',
    'State',
    'Wish',
    'WishError',
    'search',
    'wish_from',
    'wish_from_file',
]
