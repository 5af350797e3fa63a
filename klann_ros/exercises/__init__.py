"""
Exercises of both courses: a variant for each student, its key and steps, and its marking.

>>> from klann_ros.exercises import KINDS, make_variant, mark
>>> variant = make_variant(KINDS['four-bar-position'], '12345')
>>> sorted(variant.givens)
['L_1', 'L_2', 'L_3', 'L_4', 'theta_2']
>>> right = variant.answers['theta_4']
>>> [each.slip for each in mark(variant, {'theta_4': f'{right * 3.14159265 / 180:.4g}'})][-2:]
['radians', 'empty']

======================  ===================================================================
Variants                `KINDS`, `make_variant`: `Kind`, `Question`, `Variant`, `Step`
Marking                 `mark`: `Mark`; `statistics`; `check` one answer
Errors                  `ExerciseError`
======================  ===================================================================
"""

from typing import TYPE_CHECKING

from klann_ros.lazy_face import lazy_face

if TYPE_CHECKING:
    from .calculation import Step
    from .kinds import KINDS
    from .marking import Mark, mark, statistics
    from .platforms import check
    from .variant import ExerciseError, Kind, make_variant, Question, Variant
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
