"""Recording sessions from a recorder's parameters: one run, or a run for each event."""

from collections.abc import Callable
from datetime import datetime, timezone
from importlib.metadata import PackageNotFoundError, version
import os
from pathlib import Path
import platform
from typing import Any

from klann_ros import __version__
from klann_ros.log.errors import LogError
from klann_ros.log.run_parameters import RECORDER_RECORD
from klann_ros.log.write.background_writer import (
    BackgroundWriter,
    QUEUE_CAPACITY,
    SplitLimits,
)
from klann_ros.log.write.durable_file import check_free_space, RunFaults
from klann_ros.log.write.event_session import EventSession, EventSettings
from klann_ros.log.write.recording import RecordingSession
from klann_ros.log.write.unfinished import unfinished_runs
from klann_ros.log.write.writer import RunWriter
from klann_ros.nodes.parameters import StartError
from klann_ros.nodes.process import Finish
from klann_ros.sanitize.text import printable
from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.utilities import get_rmw_implementation_identifier

# A finished chunk must fit into the reserve of a full disk [bytes].
_CHUNK_SIZE = 128 * 1024
_DEFAULT_FOLDER = Path('runs')


def open_run(values: dict[str, Any], logger: RcutilsLogger, finish: Finish) -> RecordingSession:
    """
    Create a run and return its session.

    Raises
    ------
    StartError
        The folder cannot be created.

    """
    name = f'{datetime.now(timezone.utc):%Y-%m-%dT%H-%M-%SZ}'
    output = values['output'] or _DEFAULT_FOLDER / name
    try:
        run, background = _open(
            Path(output).expanduser(), values, logger, on_failure=lambda: finish(1)
        )
    except (LogError, OSError) as error:
        raise StartError(str(error)) from error
    _report_unfinished(run.path.parent, logger)
    background.put_entry(_write_recorder_info)
    logger.info(f'recording to {printable(run.path)}')
    return RecordingSession(run, background)


def open_events(values: dict[str, Any], logger: RcutilsLogger) -> EventSession:
    """
    Return a session that writes a run for each event into an existing folder.

    Raises
    ------
    StartError
        The folder cannot be created or written, or is a run.

    """
    folder = Path(values['output'] or _DEFAULT_FOLDER).expanduser().absolute()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        check_free_space(folder, values['min_free_space'])
        is_run = (folder / 'metadata.yaml').exists() or any(folder.glob('*.mcap'))
    except FileExistsError:
        raise StartError(
            f'{printable(folder)} is not a folder, so no runs can be created in it'
        ) from None
    except (LogError, OSError) as error:
        raise StartError(str(error)) from error
    if is_run:
        raise StartError(
            f'{printable(folder)} is a run; output must be a folder for the runs of events'
        )
    if not os.access(folder, os.W_OK | os.X_OK):
        raise StartError(f'{printable(folder)} is not writable')
    _report_unfinished(folder, logger)
    settings = EventSettings(
        values['pre_trigger'], values['post_trigger'], values['pre_trigger_bytes']
    )
    capacity = QUEUE_CAPACITY + settings.max_bytes
    logger.info(
        f'waiting for a trigger to record to {printable(folder)}: '
        f'{settings.pre_trigger:g} s before it, and {settings.post_trigger:g} s after'
    )
    return EventSession(
        folder,
        settings,
        open_run=lambda path: _open(path, values, logger, capacity=capacity),
        entries=[_write_recorder_info],
        on_status=lambda ok, text: logger.info(text) if ok else logger.error(text),
    )


def _open(
    path: Path,
    values: dict[str, Any],
    logger: RcutilsLogger,
    *,
    on_failure: Callable[[], object] = lambda: None,
    capacity: int = QUEUE_CAPACITY,
) -> tuple[RunWriter, BackgroundWriter]:
    """Create a run and its writer thread."""
    check_free_space(path, values['min_free_space'])
    run = RunWriter(
        path,
        compression=values['compression'],
        chunk_size=_CHUNK_SIZE,
        reserve=True,
        faults=RunFaults(logger.error),
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


def _report_unfinished(folder: Path, logger: RcutilsLogger) -> None:
    for run in unfinished_runs(folder):
        name = printable(run)
        logger.warning(f'{name} was not finished; `recover {name}` repairs it')


def _write_recorder_info(run: RunWriter) -> None:
    """Write the host and the versions of the recorder's software."""
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
