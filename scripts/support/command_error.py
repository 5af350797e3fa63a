"""What a command cannot go on from, in one line for its user."""


class CommandError(Exception):
    """A reason, and what to do about it; printed without a traceback."""
