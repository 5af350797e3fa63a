"""The run of an event while it is being opened: a disk may take its time for that."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from threading import Thread

from klann_ros.log.run_parameters import ToldFinding
from klann_ros.log.write.background_writer import BackgroundWriter
from klann_ros.log.write.writer import RunWriter

Opened = tuple[RunWriter, BackgroundWriter]
# Opens a run in a folder that is not there yet.
OpenRun = Callable[[Path], Opened]


@dataclass
class EventTimes:
    """When an event began and ends, by a clock that nobody sets [s], and when it began [ns]."""

    begin: float
    end: float
    time: int


class Opening:
    """
    Opens a run in a thread of its own: whoever hears messages goes on hearing them.

    Attributes
    ----------
    path : Path
        Where it is going to be.
    causes : list of ToldFinding
        Why.
    times : EventTimes
        From when to when.

    """

    def __init__(
        self, open_run: OpenRun, path: Path, causes: list[ToldFinding], times: EventTimes
    ) -> None:
        """Begin to open it."""
        self.path, self.causes, self.times = path, causes, times
        self._open_run = open_run
        self._opened: Opened | None = None
        self._error: Exception | None = None
        self._thread = Thread(target=self._run, name='opening', daemon=True)
        self._thread.start()

    def result(self, patience: float | None) -> Opened | None:
        """
        Return the run and what writes to it; None if it is not open after so long [s].

        Without an end to the patience it is waited for. What went wrong is raised.
        """
        self._thread.join(patience)
        if self._error is not None:
            raise self._error
        return self._opened

    def _run(self) -> None:
        try:
            self._opened = self._open_run(self.path)
        # It is raised where somebody hears of it.
        except Exception as error:
            self._error = error
