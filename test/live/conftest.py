"""A server of the live page with a fake state."""

from collections.abc import Iterator
from pathlib import Path

from fake_live_state import EVIL, FakeState, Served
from klann_ros.live.guard import Guard, new_token
from klann_ros.live.server import LiveServer
import pytest


@pytest.fixture(scope='session')
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp('served')
    (folder / 'secret.txt').write_text('nobody reads this')
    inside = folder / 'runs'
    (inside / 'good').mkdir(parents=True)
    (inside / 'good' / 'metadata.yaml').write_text('')
    (inside / EVIL.replace('/', '')).mkdir()
    (inside / EVIL.replace('/', '') / 'metadata.yaml').write_text('')
    (inside / 'link.mcap').symlink_to(folder / 'secret.txt')
    return inside


@pytest.fixture(scope='module')
def served(runs: Path) -> Iterator[Served]:
    state = FakeState()
    server = LiveServer(Guard('127.0.0.1', 0, new_token()), state, str(runs))
    yield Served(state, server)
    server.close()
