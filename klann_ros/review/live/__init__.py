"""
Holds what passes against the limits of a review, while it passes.

`LiveJudge` is given messages as they come and tells findings at most a second later. It is the
same review as of a whole run, of the last second again and again, with what only a present
can show: a topic that is silent now, and a leg that was changed.
"""

from .judge import LiveFinding, LiveJudge

__all__ = ['LiveFinding', 'LiveJudge']
