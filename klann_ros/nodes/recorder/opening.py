"""From a recorder's parameters to what it records into: one run, or a run for each event."""

from collections.abc import Callable
from datetime import datetime, timezone
from importlib.metadata import PackageNotFoundError, version
import os
from pathlib import Path
import platform
from typing import Any

from klann_ros import __version__
from klann_ros.log.errors import LogError
from klann_ros.log.events.session import EventSession, EventSettings
from klann_ros.log.run_parameters import RECORDER_RECORD
from klann_ros.log.write.background_writer import BackgroundWriter, CAPACITY, SplitLimits
from klann_ros.log.write.disk_space import check_free_space
from klann_ros.log.write.file_watch import Faults
from klann_ros.log.write.recording import RecordingSession
from klann_ros.log.write.unfinished import remove_old_reserves, unfinished_runs
from klann_ros.log.write.writer import RunWriter
from klann_ros.nodes.parameters import StartError
from klann_ros.nodes.process import Finish
from klann_ros.sanitize.text import printable
from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.utilities import get_rmw_implementation_identifier

# A finished chunk is what a full disk has to have room for yet [bytes].
CHUNK_SIZE = 128 * 1024
# Where runs are made whose names nobody gives.
RUNS = Path('runs')


def open_run(values: dict[str, Any], teller: RcutilsLogger, finish: Finish) -> RecordingSession:
    """
    Return a recording of one run, which is there.

    Raises
    ------
    StartError
        Its folder cannot be made.

    """
    output = values['output'] or RUNS / f'{datetime.now(timezone.utc):%Y-%m-%dT%H-%M-%SZ}'
    try:
        run, background = _opened(
            Path(output).expanduser(), values, teller, on_failure=lambda: finish(1)
        )
    except (LogError, OSError) as error:
        raise StartError(str(error)) from error
    _look_around(run.path.parent, teller)
    background.put_entry(_describe_recorder)
    teller.info(f'recording to {printable(run.path)}')
    return RecordingSession(run, background)


def open_events(values: dict[str, Any], teller: RcutilsLogger) -> EventSession:
    """
    Return a recording of events, each a run of its own in a folder that is there.

    Raises
    ------
    StartError
        The folder cannot be made, or is a run.

    """
    folder = Path(values['output'] or RUNS).expanduser().absolute()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        check_free_space(folder, values['min_free_space'])
        is_run = (folder / 'metadata.yaml').exists() or any(folder.glob('*.mcap'))
    except FileExistsError:
        raise StartError(
            f'{printable(folder)} is no folder, so no runs can be made in it'
        ) from None
    except (LogError, OSError) as error:
        raise StartError(str(error)) from error
    if is_run:
        raise StartError(
            f'{printable(folder)} is a run; output must be a folder for runs, one of each event'
        )
    if not os.access(folder, os.W_OK | os.X_OK):
        raise StartError(f'{printable(folder)} cannot be written to')
    _look_around(folder, teller)
    settings = EventSettings(
        values['pre_trigger'], values['post_trigger'], values['pre_trigger_bytes']
    )
    capacity = CAPACITY + settings.most_bytes
    teller.info(
        f'waiting for a cause to record to {printable(folder)}: '
        f'{settings.before:g} s before it, and {settings.after:g} s after'
    )
    return EventSession(
        folder,
        settings,
        open_run=lambda path: _opened(path, values, teller, capacity=capacity),
        entries=[_describe_recorder],
        say=lambda is_well, text: teller.info(text) if is_well else teller.error(text),
    )


def _opened(
    path: Path,
    values: dict[str, Any],
    teller: RcutilsLogger,
    *,
    on_failure: Callable[[], object] = lambda: None,
    capacity: int = CAPACITY,
) -> tuple[RunWriter, BackgroundWriter]:
    """Make a run and what writes to it."""
    check_free_space(path, values['min_free_space'])
    run = RunWriter(
        path,
        compression=values['compression'],
        chunk_size=CHUNK_SIZE,
        reserve=True,
        faults=Faults(error=teller.error, warning=teller.warning),
    )
    background = BackgroundWriter(
        run,
        flush_period=values['flush_period'],
        on_failure=on_failure,
        limits=SplitLimits(values['max_file_size'], values['max_file_duration']),
        min_free_space=values['min_free_space'],
        capacity=capacity,
    )
    return run, background


def _look_around(folder: Path, teller: RcutilsLogger) -> None:
    """Name the runs that were left unfinished."""
    remove_old_reserves(folder)
    for left in unfinished_runs(folder):
        name = printable(left)
        teller.warning(f'{name} was not finished; `recover {name}` makes it whole')


def _describe_recorder(run: RunWriter) -> None:
    """Write which versions of what record, and where."""
    run.add_metadata(
        RECORDER_RECORD,
        {
            'version': __version__,
            'host': platform.node(),
            'system': platform.platform(),
            'python': platform.python_version(),
            'ros_distro': os.environ.get('ROS_DISTRO', 'jazzy'),
            'rclpy': _version('rclpy'),
            'rmw': get_rmw_implementation_identifier(),
            'mcap': _version('mcap'),
            'started': datetime.now(timezone.utc).isoformat(),
        },
        in_every_file=True,
    )


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return 'unknown'
