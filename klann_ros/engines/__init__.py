"""
Map a pure function over many items: in processes of this machine, or on a cluster by Ray.

>>> from klann_ros.engines import mapped
>>> [answer for _, answer in sorted(mapped(abs, [-1, 2, -3], jobs=1))]
[1, 2, 3]

Answers come as they are done, each with the number of its item. An item never stops the others:
where no worker lives to answer, there is a `Failed` with the reason.
"""

from .answers import EngineError, Failed
from .mapping import ENGINES, mapped

__all__ = ['ENGINES', 'EngineError', 'Failed', 'mapped']
