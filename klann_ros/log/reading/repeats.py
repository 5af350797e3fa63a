"""What each file of a split run says again, so that each can be read alone."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Hashable, Mapping
    from pathlib import Path

    from klann_ros.log.records import Attachment


class Repeats:
    """Tells what was met in an earlier file of a run already; within one file nothing is one."""

    def __init__(self) -> None:
        self._met: dict[Hashable, Path] = {}

    def is_one(self, path: Path, key: Hashable) -> bool:
        """Return whether an earlier file than this one has the same."""
        return self._met.setdefault(key, path) != path


def metadata_key(name: str, content: Mapping[str, str]) -> Hashable:
    """Return what makes two metadata records the same."""
    return name, tuple(sorted(content.items()))


def attachment_key(attachment: Attachment) -> Hashable:
    """Return what makes two attachments the same: all but when they were attached."""
    digest = hashlib.sha256(attachment.data).digest()
    return attachment.name, attachment.media_type, digest
