"""
Many runs, each judged alone, in parallel: a row a run.

>>> from klann_ros.review.fleet import find_runs, judge_runs, Task
>>> tasks = [Task(run) for run in find_runs(['runs'])]
>>> for row in judge_runs(tasks):
...     print(row.run, row.verdict, row.reason)
"""

from .judge import (
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

__all__ = [
    'Expectations',
    'ExpectationsFileError',
    'FoundRun',
    'Row',
    'Task',
    'expectations_from_file',
    'find_runs',
    'judge',
    'judge_runs',
    'rows_from_table',
]
