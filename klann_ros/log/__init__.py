r"""
Logs of runs: crash-safe MCAP for every tool, read in any state.

Writing is a context manager, reading an iterator of typed records, also from the other formats of
rosbag2 (SQLite, compressed files, compressed messages):

>>> from pathlib import Path
>>> from tempfile import TemporaryDirectory
>>> from klann_ros.log import Message, open_log, recover, RunWriter, Topic
>>> folder = TemporaryDirectory()
>>> run = Path(folder.name, 'walk')
>>> topic = Topic('/crank_angle', 'std_msgs/msg/Float64', definition='float64 data\n')
>>> with RunWriter(run) as writer:
...     writer.write(Message(topic, bytes(12), log_time=2, publish_time=1, sequence=1))
...     writer.flush()  # from here on neither kill -9 nor a power cut takes it back
...     writer.attach('leg.yaml', 'application/yaml', b'l_ab: 0.12', log_time=2)
...     writer.add_metadata('solver', {'tolerance': '1e-12'})
>>> with open_log(run) as log:
...     for message in log.messages():
...         print(message.topic.name, message.log_time, len(message.data))
...     print(log.metadata['solver'], log.complete)
/crank_angle 2 12
[{'tolerance': '1e-12'}] True

Damaged parts are left out and reported; a recovery makes a new run from the rest:

>>> path = run / 'walk_0.mcap'
>>> path.write_bytes(path.read_bytes()[:-100]) > 0  # as after a kill
True
>>> with open_log(run) as log:
...     print(log.problem)
walk_0.mcap at byte ...: it was not closed: there is no footer at its end
>>> recovery = recover(run, run.with_name('again'))
>>> recovery.messages, recovery.lost
(1, [])
>>> folder.cleanup()

Errors are `LogError` and its subclasses, one line each; an OSError is an error of the disk.
"""

from typing import TYPE_CHECKING

from klann_ros.lazy_face import lazy_face

if TYPE_CHECKING:
    from .bag_metadata import FILE_NAME, ros_distro
    from .definitions import definition, is_installed, split_type
    from .errors import (
        LogError,
        MalformedQosError,
        NotALogError,
        RunClosedError,
        RunExistsError,
        RunIncompleteError,
        UnknownTypeError,
        UnwritableError,
    )
    from .extension import extend, TopicMessages
    from .loss import LossCounter
    from .mcap.growing import GrowingFile, NamedRecord
    from .playback import length, Playback, Selection
    from .qos import latched_count, Qos, qos_to_yaml, QosTexts
    from .read.run_files import is_log_name, LOG_HELP, natural_key, run_files, run_name
    from .read.storage import block_of_messages, HEAD, LAST_TIME, MessageBlock
    from .reader import Log, LogTimes, MAX_ROS_TIME, open_log
    from .records import ANNOTATION, Attachment, Message, Topic
    from .recovery import recover, Recovery
    from .run_parameters import (
        described_solver,
        DESCRIPTION_TOPIC,
        FAULT_RECORD,
        FINDING_RECORD,
        leg_description,
        LINKAGE_PARAMETER,
        LOSS_RECORD,
        Pause,
        PAUSE_RECORD,
        recorded_finding,
        recorded_pause,
        RecordedFinding,
        RECORDER_RECORD,
        REPLAYED_PARAMETER,
        replayed_solvers,
        replayed_solvers_json,
        SolverParameters,
        STRING_TYPE,
        topic_counts,
        TopicCount,
    )
    from .transport import PlaybackError, RATES, Transport
    from .write.background_writer import BackgroundWriter, QUEUE_CAPACITY, SplitLimits
    from .write.durable_file import check_free_space, is_being_written, RunFaults
    from .write.event_session import EventSession, EventSettings, Recording
    from .write.mcap_file import COMPRESSIONS
    from .write.recording import RecordingSession, RecordingState
    from .write.run_folder import unfinished_runs
    from .write.writer import RunWriter
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
