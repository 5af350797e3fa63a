"""How rosbag2 itself makes an MCAP run of a bag that only its plugins can read."""

from __future__ import annotations

import json
import shlex
from typing import TYPE_CHECKING

from klann_ros.untrusted.text import printable

if TYPE_CHECKING:
    from pathlib import Path

# It is there to be copied, and names the folder twice.
_LONGEST = 2000


def convert_command(folder: Path) -> str:
    """Return the command line, as a half sentence (rosbag2's README, "Converting bags")."""
    output = json.dumps(f'{folder}_mcap')
    options = f'output_bags: [{{uri: {output}, storage_id: mcap, all: true}}]'
    words = f'echo {shlex.quote(options)} > to.yaml && ros2 bag convert -i '
    command = f'{words}{shlex.quote(str(folder))} -o to.yaml'
    return f'`{printable(command, _LONGEST)}` makes a run of it'
