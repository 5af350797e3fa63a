"""Runs that are being written, and what somebody may do to their files meanwhile."""

import os
from pathlib import Path

from klann_ros.log.errors import RunHarmedError
from klann_ros.log.reader import open_log
from klann_ros.log.write.file_watch import Faults
from klann_ros.log.write.writer import RunWriter
import yaml


class Run:
    """A run that is being written, message by message, and what was said of it."""

    def __init__(self, runs, folder):
        self.errors, self.warnings = [], []
        faults = Faults(error=self.errors.append, warning=self.warnings.append)
        self.writer = RunWriter(folder, faults=faults, compression='none')
        self.folder = folder
        self._messages = iter(runs.make_messages(10_000))

    def write(self, count=10):
        for _ in range(count):
            self.writer.write(next(self._messages))
        self.writer.flush()
        return self

    def file(self, number=0):
        return self.folder / f'{self.folder.name}_{number}.mcap'

    def close(self):
        """Finish it; return how many messages it says are in it, and are gone."""
        try:
            self.writer.close()
        except RunHarmedError as error:
            assert self.errors, error
        else:
            assert not self.errors
        fate = self.writer.fate()
        assert found_in(self.writer.path) == fate.written.total()
        assert information(self.writer.path)['message_count'] == fate.written.total()
        return fate.written.total(), fate.gone.total()


def found_in(folder):
    """Return how many messages a reader finds."""
    with open_log(folder) as log:
        messages = [message.sequence for message in log.messages()]
    assert messages == sorted(set(messages))
    return len(messages)


def information(run):
    return yaml.safe_load((run / 'metadata.yaml').read_text())['rosbag2_bagfile_information']


def listed(run):
    return information(run)['relative_file_paths']


def overwrite(path):
    """Write another file over it, as `cp` does: longer, but the inode stays."""
    with path.open('r+b') as file:
        file.truncate(0)
        file.write(b'something else' * 5000)


def fill_with_zeros(path):
    """Cut it to nothing and stretch it to what it was."""
    size = path.stat().st_size
    os.truncate(path, 0)
    os.truncate(path, size)


def replace_by_another(path):
    other = path.with_name('other')
    other.write_bytes(b'something else')
    other.replace(path)


def replace_by_folder(path):
    path.unlink()
    path.mkdir()


def replace_by_pipe(path):
    path.unlink()
    os.mkfifo(path)


def replace_by_loop(path):
    path.unlink()
    path.symlink_to(path)


HARMS = {
    'rm': (Path.unlink, 'run_0.mcap was removed while it was recorded, with 10 messages in it'),
    'mv other over it': (replace_by_another, 'run_0.mcap was removed'),
    'rm, mkdir': (replace_by_folder, 'run_0.mcap was removed'),
    'rm, mkfifo': (replace_by_pipe, 'run_0.mcap was removed'),
    'rm, ln -s': (replace_by_loop, 'run_0.mcap was removed'),
    'truncate -s 0': (lambda path: os.truncate(path, 0), 'run_0.mcap was cut off or overwritten'),
    'truncate -s 100': (
        lambda path: os.truncate(path, 100),
        'its 10 messages count as lost; `recover ',
    ),
    'truncate -s -1': (
        lambda path: os.truncate(path, path.stat().st_size - 1),
        'run_0.mcap was cut off',
    ),
    'cp other': (overwrite, 'run_0.mcap was cut off or overwritten'),
    'zeros': (fill_with_zeros, 'run_0.mcap was cut off or overwritten'),
}
