"""The parts of walkers for the live page, which draws bars until they are made."""

from collections.abc import Mapping
import json
import os
import sys
from threading import Thread
from typing import Any

from klann_ros.engines import parallel_map, TaskError
from klann_ros.export import scene_parts
from klann_ros.robot import robot_from_parameters

# Limit of the search for layers: it takes seconds, on a busy machine minutes [s].
TIMEOUT = 300.0
# Walkers with parts; one that is resized all the time would have no end.
_MAX_WALKERS = 16


class WalkerParts:
    """Make the parts of walkers in another process, one after the other; to be polled."""

    def __init__(self) -> None:
        # Parts by the text of the parameters; None where there are none.
        self._parts: dict[str, dict[str, Any] | None] = {}
        self._thread = Thread()

    def of(self, parameters: Mapping[str, Any]) -> dict[str, Any] | None:
        """Return the parts of a walker's parameters; None without, or until they are made."""
        text = json.dumps(parameters, sort_keys=True, default=str)
        if text not in self._parts and not self._thread.is_alive():
            self._thread = Thread(target=self._make, args=(text,), name='parts', daemon=True)
            self._thread.start()
        return self._parts.get(text)

    def _make(self, text: str) -> None:
        if len(self._parts) >= _MAX_WALKERS:
            del self._parts[next(iter(self._parts))]
        # It stays where no process can be started, too.
        self._parts[text] = None
        for _, parts in parallel_map(make_parts, [text], jobs=1, time_limit=TIMEOUT):
            if not isinstance(parts, TaskError):
                self._parts[text] = parts


def make_parts(text: str) -> dict[str, Any]:
    """Return the parts of the robot of parameters as JSON; errors as robot and parts have them."""
    # The legs come first.
    if sys.platform != 'win32':
        os.nice(10)
    return scene_parts(robot_from_parameters(json.loads(text), weigh=False))
