"""How much space is free where a run is, or is going to be."""

from pathlib import Path
import shutil

from klann_ros.log.errors import LowSpaceError


def free_space(folder: Path) -> int:
    """
    Return how much this user may still write on the disk of a folder, there or not [bytes].

    Raises
    ------
    OSError
        The disk does not tell.

    """
    there = folder.absolute()
    while not there.exists() and there != there.parent:
        there = there.parent
    return shutil.disk_usage(there).free


def check_free_space(folder: Path, least: int) -> None:
    """
    Let a folder be written to as long as so much is free on its disk [bytes]; 0 is no limit.

    Raises
    ------
    LowSpaceError
        Less is free.
    OSError
        The disk does not tell.

    """
    if least > 0 and (free := free_space(folder)) < least:
        raise LowSpaceError(folder, free, least)
