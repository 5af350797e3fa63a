"""
The metadata of a rosbag2 bag, version 9 (Jazzy), as data and as YAML.

The same mapping stands in two places: in the run's ``metadata.yaml`` under a root key, and,
without that key, in the MCAP metadata record ``rosbag2`` under ``serialized_metadata``.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
import os
from pathlib import Path
import sys

from klann_ros.sanitize import yaml_text

from .qos import qos_from_yaml, qos_to_data
from .records import Topic

VERSION = 9
ROOT_KEY = 'rosbag2_bagfile_information'
RECORD_NAME = 'rosbag2'
RECORD_KEY = 'serialized_metadata'
FILE_NAME = 'metadata.yaml'
# Keys of a channel's metadata.
QOS_KEY = 'offered_qos_profiles'
HASH_KEY = 'topic_type_hash'


@dataclass
class FileSummary:
    """The content of one file of a run."""

    # The file's name in the run's folder.
    name: str
    # Messages per topic.
    counts: dict[Topic, int] = field(default_factory=dict)
    # Log time of the earliest and the latest message [ns]; 0 without any.
    start_time: int = 0
    end_time: int = 0

    @property
    def message_count(self) -> int:
        """Return the number of messages of all topics."""
        return sum(self.counts.values())


def metadata_yaml(files: Sequence[FileSummary]) -> str:
    """Return the text of ``metadata.yaml`` for a run of these files."""
    return yaml_text.dump({ROOT_KEY: _metadata(files)}) + '\n'


def metadata_record(files: Sequence[FileSummary]) -> dict[str, str]:
    """Return the content of the MCAP metadata record ``rosbag2`` for a run of these files."""
    return {RECORD_KEY: yaml_text.dump(_metadata(files))}


def _metadata(files: Sequence[FileSummary]) -> dict[str, object]:
    """Return rosbag2's description of a run; a MalformedQosError for a topic's QoS."""
    filled = [file for file in files if file.message_count]
    start = min((file.start_time for file in filled), default=0)
    end = max((file.end_time for file in filled), default=0)
    counts: dict[Topic, int] = {}
    for file in files:
        for topic, count in file.counts.items():
            counts[topic] = counts.get(topic, 0) + count
    return {
        'version': VERSION,
        'storage_identifier': 'mcap',
        'duration': {'nanoseconds': end - start},
        'starting_time': {'nanoseconds_since_epoch': start},
        'message_count': sum(file.message_count for file in files),
        'topics_with_message_count': [
            {'topic_metadata': _topic_metadata(topic), 'message_count': count}
            for topic, count in counts.items()
        ],
        # Compression by rosbag2 itself, not that of the chunks.
        'compression_format': '',
        'compression_mode': '',
        'relative_file_paths': [file.name for file in files],
        'files': [_file_metadata(file) for file in files],
        'custom_data': None,
        'ros_distro': ros_distro(),
    }


def ros_distro() -> str:
    """Return the name of the ROS distribution: the sourced one, that of the wheels, or Jazzy."""
    rclpy = sys.modules.get('rclpy')
    if rclpy is not None and 'ROS_DISTRO' not in os.environ:
        site_packages = Path(rclpy.__path__[0]).parent
        for wheel in site_packages.glob('ros_*_rclpy-*.dist-info'):
            return wheel.name.split('_')[1]
    return os.environ.get('ROS_DISTRO') or 'jazzy'


def _topic_metadata(topic: Topic) -> dict[str, object]:
    return {
        'name': topic.name,
        'type': topic.type,
        'serialization_format': topic.message_encoding,
        'offered_qos_profiles': [qos_to_data(profile) for profile in qos_from_yaml(topic.qos)],
        'type_description_hash': topic.type_hash,
    }


def _file_metadata(file: FileSummary) -> dict[str, object]:
    return {
        'path': file.name,
        'starting_time': {'nanoseconds_since_epoch': file.start_time},
        'duration': {'nanoseconds': file.end_time - file.start_time},
        'message_count': file.message_count,
    }
