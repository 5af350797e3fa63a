"""Settings of all tests."""

from hypothesis import settings

# No test asserts a time, and neither does hypothesis: the machine may be busy.
settings.register_profile('untimed', deadline=None)
settings.load_profile('untimed')
