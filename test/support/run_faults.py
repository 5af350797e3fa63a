"""A run in progress, and outside changes of its files."""

import os
from pathlib import Path

from crank_runs import make_messages
from klann_ros.log.errors import RunIncompleteError
from klann_ros.log.reader import open_log
from klann_ros.log.write.durable_file import RunFaults
from klann_ros.log.write.writer import RunWriter
import yaml


class Run:
    """A run that is written message by message, and its reported faults."""

    def __init__(self, folder):
        self.errors = []
        self.writer = RunWriter(folder, faults=RunFaults(self.errors.append), compression='none')
        self.folder = folder
        self.messages = iter(make_messages(10_000))

    def write(self, count=10):
        for _ in range(count):
            self.writer.write(next(self.messages))
        self.writer.flush()
        return self

    def file(self, number=0):
        return self.folder / f'{self.folder.name}_{number}.mcap'

    def counts(self):
        """Return the messages in the run, and the dropped ones."""
        stored = self.writer.stored_counts()
        return stored.written.total(), stored.dropped.total()

    def close(self):
        """Finish it; return its counts, which are those of a reader."""
        try:
            self.writer.close()
        except RunIncompleteError as error:
            assert self.errors, error
        else:
            assert not self.errors
        written, dropped = self.counts()
        assert found_in(self.writer.path) == written
        assert information(self.writer.path)['message_count'] == written
        return written, dropped


def found_in(folder):
    """Return the number of messages that a reader finds."""
    with open_log(folder) as log:
        messages = [message.sequence for message in log.messages()]
    assert messages == sorted(set(messages))
    return len(messages)


def information(run):
    return yaml.safe_load((run / 'metadata.yaml').read_text())['rosbag2_bagfile_information']


def listed(run):
    return information(run)['relative_file_paths']


def disk_error(number):
    """Return a function that fails as a disk does."""

    def fail(*_):
        raise OSError(number, os.strerror(number))

    return fail


def copy_over(path):
    """Overwrite it as `cp` does: the inode stays."""
    with path.open('r+b') as file:
        file.truncate(0)
        file.write(b'something else' * 5000)


def replace_by(make):
    def replace(path):
        path.unlink()
        make(path)

    return replace


def append(path):
    with path.open('ab') as file:
        file.write(b'x' * 100_000)


GONE = {
    'rm': Path.unlink,
    'mv other': replace_by(lambda path: path.write_bytes(b'something else')),
    'mkdir': replace_by(Path.mkdir),
    'mkfifo': replace_by(os.mkfifo),
    'ln -s': replace_by(lambda path: path.symlink_to(path)),
}
CHANGED = {
    'truncate -s 0': lambda path: os.truncate(path, 0),
    'truncate -s -1': lambda path: os.truncate(path, max(path.stat().st_size - 1, 0)),
    'cp other': copy_over,
    'append': append,
}
CHANGES = GONE | CHANGED
