"""How many Newton iterations the solver reports, from the diagnostics in a run."""

from collections import defaultdict
from contextlib import suppress
from functools import partial
from typing import Any

from klann_ros.log.reading.block import Block
from klann_ros.log.records import Topic
from klann_ros.review.recording import no_series, Series
import numpy as np

from .columns import Columns
from .decoders import decoder
from .pieces import nanoseconds, Rows
from .shared import Shared

DIAGNOSTICS = 'diagnostic_msgs/msg/DiagnosticArray'
# How a solver calls its only leg.
_UNNAMED = 'leg'


class Iterations:
    """Gathers the iterations from diagnostics: the most that a pose took since the last report."""

    def __init__(self) -> None:
        self._columns: dict[str, Columns] = defaultdict(partial(Columns, 1))
        self._solvers: dict[str, set[str]] = defaultdict(set)
        self._decoders: dict[Topic, Any] = {}

    def add(self, topic: Topic, block: Block, rows: Rows) -> None:
        """Add what a topic's messages in a block report."""
        if topic.type != DIAGNOSTICS:
            return
        if topic not in self._decoders:
            self._decoders[topic] = decoder(topic)
        for row in rows.tolist():
            # A message that is none tells nothing of a leg.
            with suppress(Exception):
                message = self._decoders[topic](block.message(row))
                self._report(message, nanoseconds(block.heads['log_time'][[row]]))

    def series(self, name: str) -> Series:
        """Return what is reported of a leg; nothing where several solvers have one of the name."""
        name = name or _UNNAMED
        if name not in self._columns or len(self._solvers[name]) > 1:
            return no_series(1)
        return self._columns[name].series(Shared())

    def _report(self, message: Any, time: 'np.ndarray[Any, np.dtype[np.int64]]') -> None:
        for status in message.status:
            solver, _, leg = str(status.name).rpartition(': ')
            for value in status.values:
                if solver and value.key == 'iterations':
                    self._solvers[leg].add(solver)
                    self._columns[leg].add(time, time, np.array([[float(value.value)]]))
