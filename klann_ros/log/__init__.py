r"""
Logs of runs: crash-safe MCAP for every tool, read in any state.

Writing is a context manager, reading an iterator of typed records, also from the other formats of
rosbag2 (SQLite, compressed files, compressed messages):

>>> from pathlib import Path
>>> from tempfile import TemporaryDirectory
>>> from klann_ros.log import Message, open_log, recover, RunWriter, Topic
>>> folder = TemporaryDirectory()
>>> run = Path(folder.name, 'walk')
>>> topic = Topic('/crank_angle', 'std_msgs/msg/Float64', definition='float64 data\n')
>>> with RunWriter(run) as writer:
...     writer.write(Message(topic, bytes(12), log_time=2, publish_time=1, sequence=1))
...     writer.flush()  # from here on neither kill -9 nor a power cut takes it back
...     writer.attach('leg.yaml', 'application/yaml', b'l_ab: 0.12', log_time=2)
...     writer.add_metadata('solver', {'tolerance': '1e-12'})
>>> with open_log(run) as log:
...     for message in log.messages():
...         print(message.topic.name, message.log_time, len(message.data))
...     print(log.metadata['solver'], log.complete)
/crank_angle 2 12
[{'tolerance': '1e-12'}] True

Damaged parts are left out and reported; a recovery makes a new run from the rest:

>>> path = run / 'walk_0.mcap'
>>> path.write_bytes(path.read_bytes()[:-100]) > 0  # as after a kill
True
>>> with open_log(run) as log:
...     print(log.problem)
walk_0.mcap at byte ...: it was not closed: there is no footer at its end
>>> recovery = recover(run, run.with_name('again'))
>>> recovery.messages, recovery.lost
(1, [])
>>> folder.cleanup()

Errors are `LogError` and its subclasses, one line each; an OSError is an error of the disk.
"""

from importlib import import_module
from typing import Any, TYPE_CHECKING

if TYPE_CHECKING:
    from .errors import (
        LogError,
        MalformedQosError,
        NotALogError,
        RunClosedError,
        RunExistsError,
        RunIncompleteError,
        UnknownTypeError,
        UnwritableError,
    )
    from .reader import Log, open_log
    from .records import Attachment, Message, Topic
    from .recovery import recover, Recovery
    from .write.writer import RunWriter

__all__ = [
    'Attachment',
    'Log',
    'LogError',
    'MalformedQosError',
    'Message',
    'NotALogError',
    'Recovery',
    'RunClosedError',
    'RunExistsError',
    'RunIncompleteError',
    'RunWriter',
    'Topic',
    'UnknownTypeError',
    'UnwritableError',
    'open_log',
    'recover',
]

_PLACES = {
    'Attachment': 'records',
    'Log': 'reader',
    'Message': 'records',
    'Recovery': 'recovery',
    'RunWriter': 'write.writer',
    'Topic': 'records',
    'open_log': 'reader',
    'recover': 'recovery',
}


def __dir__() -> list[str]:
    return [*globals(), *__all__]


def __getattr__(name: str) -> Any:
    """Import on demand: a solver counts losses with this package, and needs no MCAP."""
    if name not in __all__:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    return getattr(import_module(f'.{_PLACES.get(name, "errors")}', __name__), name)
