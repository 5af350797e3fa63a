"""
Many runs, each judged alone: a row a run, whichever machine works on it.

>>> from klann_ros.review.fleet import find_runs, judge_runs, Task
>>> tasks = [Task(run) for run in find_runs(['runs'])]
>>> for row in judge_runs(tasks):
...     print(row.run, row.verdict, row.reason)
"""

from .expectations import Expectations, expectations_from_file, ExpectationsFileError
from .judge import find_runs, FoundRun, judge, judge_runs, Task
from .table import Row

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
]
