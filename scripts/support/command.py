"""What the commands have in common: how they begin and how they end."""

import sys

from command_error import CommandError
import processes
from stop import StoppedError


def command(name: str, arguments: list[str]) -> int:
    """Run demo, test, fuzz or benchmark; return its exit code, and leave no process behind."""
    processes.adopt_orphans()
    try:
        return _run(name, arguments)
    except (CommandError, StoppedError) as error:
        sys.stdout.flush()
        print(f'scripts/{name}: {error}', file=sys.stderr)
        return error.exit_code if isinstance(error, StoppedError) else 1
    except BrokenPipeError:
        # The reader of our output has gone (scripts/test | head): nothing more can be said.
        return 1
    finally:
        processes.end_orphans()


def _run(name: str, arguments: list[str]) -> int:
    if name == 'demo':
        import demo  # noqa: PLC0415 - each command loads what it needs

        return demo.main(arguments)
    if name == 'benchmark':
        import benchmarks  # noqa: PLC0415

        return benchmarks.main(arguments)
    if name == 'fuzz':
        import fuzz  # noqa: PLC0415

        return fuzz.main(arguments)
    import checks  # noqa: PLC0415

    return checks.main(arguments)
