"""
Judge messages during the recording.

`LiveJudge` reviews the last second repeatedly and reports findings within a second. It adds what a
finished run does not have: a topic that is silent now, and a leg that was changed.
"""

from .judge import LiveFinding, LiveJudge

__all__ = ['LiveFinding', 'LiveJudge']
