"""Settings of all tests."""

from hypothesis import settings
import pytest

# No test asserts a time, and neither does hypothesis: the machine may be busy.
settings.register_profile('untimed', deadline=None)
settings.load_profile('untimed')

# Tests of real processes on real DDS: one after the other, so that they do not starve each other.
ONE_BY_ONE = ('/test/nodes/', '/test/packaging/', '/test_real_run.py')


@pytest.hookimpl(tryfirst=True)  # before the workers look at the groups
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Let one worker have all tests that run one by one, where there are several."""
    for item in items:
        if any(part in item.path.as_posix() for part in ONE_BY_ONE):
            item.add_marker(pytest.mark.xdist_group('one by one'))
