"""
Many runs, each judged alone, in parallel: a row a run.

>>> from klann_ros.review.fleet import find_runs, judge_runs, Task
>>> tasks = [Task(run) for run in find_runs(['runs'])]
>>> for row in judge_runs(tasks):
...     print(row.run, row.verdict, row.reason)
"""

from typing import TYPE_CHECKING

from klann_ros.lazy_face import lazy_face

if TYPE_CHECKING:
    from .judging import (
        Expectations,
        expectations_from_file,
        ExpectationsFileError,
        find_runs,
        FoundRun,
        judge,
        judge_runs,
        Task,
    )
    from .rows import Row, rows_from_table
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
