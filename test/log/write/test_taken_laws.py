"""Whatever is taken away in whatever order: what is told of a run is what a reader finds in it."""

from pathlib import Path
import shutil
import tempfile

from hypothesis import settings, strategies as st
from hypothesis.stateful import precondition, rule, RuleBasedStateMachine
from klann_ros.log.errors import RunHarmedError
from klann_ros.log.reader import open_log
from klann_ros.log.records import Message, Topic
from klann_ros.log.write.file_watch import Faults
from klann_ros.log.write.writer import RunWriter
import pytest
from taken_away import HARMS, information

TOPIC = Topic('/crank_angle', 'std_msgs/msg/Float64', 'float64 data\n')
MESSAGES = [Message(TOPIC, bytes(12), n, n, n) for n in range(2000)]


def move(path):
    path.rename(path.with_name(f'kept {path.name}'))


WAYS = [move, *(harm for harm, _ in HARMS.values())]


class Taking(RuleBasedStateMachine):
    """A run that is written and taken away; `is_harmed` says whether anything should be told."""

    def __init__(self):
        super().__init__()
        self.place = Path(tempfile.mkdtemp())
        self.folder = self.place / 'run'
        self.told = []
        faults = Faults(error=self.told.append)
        self.writer = RunWriter(self.folder, compression='none', chunk_size=400, faults=faults)
        self.put, self.renamed, self.is_harmed = 0, 0, False

    @rule(count=st.integers(1, 20))
    def write(self, count):
        for message in MESSAGES[slice(self.put, self.put + count)]:
            self.writer.write(message)
            self.put += 1

    @rule()
    def flush(self):
        self.writer.flush()

    @rule()
    def look(self):
        self.writer.look()

    @rule()
    def split(self):
        self.writer.split()

    @rule(harm=st.sampled_from(WAYS), number=st.integers(0, 20))
    @precondition(lambda self: self.folder.exists())
    def harm_a_file(self, harm, number):
        files = sorted(path for path in self.folder.glob('run_*.mcap') if path.is_file())
        if files:
            harm(files[number % len(files)])
            self.is_harmed = True

    @rule(ahead=st.integers(1, 9))
    @precondition(lambda self: self.folder.exists())
    def move_to_a_later_name(self, ahead):
        # Of the file in progress: a finished one would be read as what continues the run.
        path = self.folder / self.writer.file_path.name
        if path.is_file():
            last = max(
                int(other.stem.rpartition('_')[2]) for other in self.folder.glob('run_*.mcap')
            )
            path.rename(path.with_name(f'run_{last + ahead}.mcap'))
            self.is_harmed = True

    @rule()
    @precondition(lambda self: self.folder.exists())
    def append(self):
        for path in self.folder.glob('run_*.mcap'):
            if path.is_file():
                with path.open('ab') as file:
                    file.write(b'more' * 100)

    @rule()
    @precondition(lambda self: self.folder.exists())
    def remove_metadata(self):
        (self.folder / 'metadata.yaml').unlink(missing_ok=True)

    @rule()
    @precondition(lambda self: self.folder.exists())
    def remove_folder(self):
        shutil.rmtree(self.folder)
        self.is_harmed = True

    @rule()
    @precondition(lambda self: self.folder.exists())
    def rename_folder(self):
        self.renamed += 1
        self.folder = self.folder.rename(self.place / f'name_{self.renamed}')
        self.writer.look()

    def teardown(self):
        try:
            self.writer.close()
        except RunHarmedError:
            assert self.is_harmed
        fate = self.writer.fate()
        assert fate.written.total() + fate.gone.total() == self.put
        assert bool(self.told) or not fate.gone.total()
        with open_log(self.writer.path) as log:
            found = [message.sequence for message in log.messages()]
        assert found == sorted(set(found))
        assert len(found) == fate.written.total()
        metadata = information(self.writer.path)
        assert metadata['message_count'] == len(found)
        assert all((self.writer.path / name).is_file() for name in metadata['relative_file_paths'])
        shutil.rmtree(self.place)


TestTaking = pytest.mark.filterwarnings('error')(Taking.TestCase)
TestTaking.settings = settings(max_examples=25, stateful_step_count=20, deadline=None)
