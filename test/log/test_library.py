"""The log package as a library: its face, and the example in its description."""

import doctest
import subprocess
import sys

import klann_ros.log


def test_the_example_runs() -> None:
    result = doctest.testmod(klann_ros.log, optionflags=doctest.ELLIPSIS)
    assert result.attempted > 8
    assert result.failed == 0


def test_every_name_of_its_face_is_there() -> None:
    for name in klann_ros.log.__all__:
        assert getattr(klann_ros.log, name).__doc__


def test_to_count_losses_takes_no_mcap() -> None:
    code = 'import sys, klann_ros.log.loss; sys.exit("mcap" in sys.modules)'
    assert subprocess.run([sys.executable, '-c', code], check=False).returncode == 0
