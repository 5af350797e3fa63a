"""Run a command in this process."""

from contextlib import redirect_stderr, redirect_stdout
import io


def run(main, arguments):
    """Return the exit code of a command and all that it says."""
    said = io.StringIO()
    with redirect_stdout(said), redirect_stderr(said):
        code = main(arguments)
    return code, said.getvalue()
