"""How far a review has come, for whoever waits for it at a terminal."""

from collections.abc import Iterator
from contextlib import contextmanager
import sys

from tqdm import tqdm

from .reviewing import Progress

# What takes less than this shows nothing [s].
_PATIENCE = 1.0


@contextmanager
def progress() -> Iterator[Progress]:
    """Show a bar on stderr, if that is a terminal and it takes long; yield what moves it."""
    form = '{desc}: {percentage:3.0f} %|{bar}| {remaining}'
    with tqdm(
        total=1.0, bar_format=form, delay=_PATIENCE, leave=False, file=sys.stderr, disable=None
    ) as bar:

        def tell(what: str, part: float) -> None:
            if part < bar.n:
                bar.reset()
            bar.set_description_str(what, refresh=False)
            bar.update(part - bar.n)

        yield tell
