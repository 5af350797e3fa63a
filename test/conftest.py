"""Settings of all tests."""

from zlib import crc32

from hypothesis import settings
import pytest

# No test asserts a time, and neither does hypothesis: the machine may be busy.
settings.register_profile('untimed', deadline=None)
settings.load_profile('untimed')

# Tests of real processes on real DDS: they wait more than they compute, so two lines of them run
# side by side, in domains of their own; each is run one by one, so that none starves the others.
ONE_BY_ONE = ('/test/nodes/', '/test/packaging/', '/test_real_', '/test_launched_')


@pytest.hookimpl(tryfirst=True)  # before the workers look at the groups
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Let two workers have the tests that run one by one, whole files each, if there are more."""
    for item in items:
        if any(part in item.path.as_posix() for part in ONE_BY_ONE):
            line = crc32(item.path.name.encode()) % 2
            item.add_marker(pytest.mark.xdist_group(f'one by one {line}'))
