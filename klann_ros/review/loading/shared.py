"""Arrays that say the same are kept once: answers have the stamps of their questions."""

import numpy as np

from .layouts import Times


class Shared:
    """Gives for each array of times one that is equal, the same for all that are."""

    def __init__(self) -> None:
        self._known: dict[tuple[int, int, int], list[Times]] = {}

    def one(self, times: Times) -> Times:
        """Return an array with these times."""
        if not len(times):
            return times
        alike = self._known.setdefault((len(times), int(times[0]), int(times[-1])), [])
        for known in alike:
            if np.array_equal(known, times):
                return known
        alike.append(times)
        return times
