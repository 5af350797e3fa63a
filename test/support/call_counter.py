"""Work as a number of calls: time depends on the load of the machine."""

import sys


class Work:
    """
    Counts the function calls, of Python and of C, that are made while it is entered.

    Attributes
    ----------
    calls
        How many there were.

    """

    def __init__(self):
        self.calls = 0

    def __enter__(self):
        self._before = sys.getprofile()
        sys.setprofile(self._count)
        return self

    def __exit__(self, *_):
        sys.setprofile(self._before)

    def _count(self, _frame, event, _argument):
        if event in ('call', 'c_call'):
            self.calls += 1
