"""Any sequence of outside changes: the counts of a run are those of a reader."""

from pathlib import Path
import shutil
import tempfile

from hypothesis import settings, strategies as st
from hypothesis.stateful import precondition, rule, RuleBasedStateMachine
from klann_ros.log.errors import RunIncompleteError
from klann_ros.log.reader import open_log
from klann_ros.log.records import Message, Topic
from klann_ros.log.write.durable_file import RunFaults
from klann_ros.log.write.writer import RunWriter
import pytest
from run_faults import CHANGES, information

TOPIC = Topic('/crank_angle', 'std_msgs/msg/Float64', 'float64 data\n')
MESSAGES = [Message(TOPIC, bytes(12), n, n, n) for n in range(2000)]


def move(path):
    path.rename(path.with_name(f'kept {path.name}'))


class ChangedRun(RuleBasedStateMachine):
    """A run in progress whose files and folder are changed."""

    def __init__(self):
        super().__init__()
        self.place = Path(tempfile.mkdtemp())
        self.folder = self.place / 'run'
        self.errors = []
        faults = RunFaults(self.errors.append)
        self.writer = RunWriter(self.folder, compression='none', chunk_size=400, faults=faults)
        self.put, self.renamed, self.is_changed = 0, 0, False

    @rule(count=st.integers(1, 20))
    def write(self, count):
        for message in MESSAGES[slice(self.put, self.put + count)]:
            self.writer.write(message)
            self.put += 1

    @rule()
    def flush(self):
        self.writer.flush()

    @rule()
    def check(self):
        self.writer.check_files()

    @rule()
    def split(self):
        self.writer.split()

    @rule(change=st.sampled_from([move, *CHANGES.values()]), number=st.integers(0, 20))
    @precondition(lambda self: self.folder.exists())
    def change_file(self, change, number):
        files = sorted(path for path in self.folder.glob('run_*.mcap') if path.is_file())
        if files:
            change(files[number % len(files)])
            self.is_changed = True

    @rule(ahead=st.integers(1, 9))
    @precondition(lambda self: self.folder.exists())
    def move_to_a_later_name(self, ahead):
        # Of the file in progress: a finished one would be read as what continues the run.
        path = self.folder / self.writer.file.path.name
        if path.is_file():
            last = max(
                int(other.stem.rpartition('_')[2]) for other in self.folder.glob('run_*.mcap')
            )
            path.rename(path.with_name(f'run_{last + ahead}.mcap'))
            self.is_changed = True

    @rule()
    @precondition(lambda self: self.folder.exists())
    def remove_metadata(self):
        (self.folder / 'metadata.yaml').unlink(missing_ok=True)

    @rule()
    @precondition(lambda self: self.folder.exists())
    def remove_folder(self):
        shutil.rmtree(self.folder)
        self.is_changed = True

    @rule()
    @precondition(lambda self: self.folder.exists())
    def rename_folder(self):
        self.renamed += 1
        self.folder.rename(self.place / f'name_{self.renamed}')
        self.is_changed = True

    def teardown(self):
        try:
            self.writer.close()
        except RunIncompleteError:
            assert self.is_changed
        stored = self.writer.stored_counts()
        assert stored.written.total() + stored.dropped.total() == self.put
        assert bool(self.errors) or not stored.dropped.total()
        with open_log(self.folder) as log:
            sequences = [message.sequence for message in log.messages()]
        assert sequences == sorted(set(sequences))
        assert len(sequences) == stored.written.total()
        metadata = information(self.folder)
        assert metadata['message_count'] == len(sequences)
        assert all((self.folder / name).is_file() for name in metadata['relative_file_paths'])
        shutil.rmtree(self.place)


TestChangedRun = pytest.mark.filterwarnings('error')(ChangedRun.TestCase)
TestChangedRun.settings = settings(max_examples=25, stateful_step_count=20, deadline=None)
