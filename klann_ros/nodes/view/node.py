"""`view_node`: legs live in a browser, and their control."""

import argparse
from collections.abc import Sequence
from pathlib import Path
import sys
from threading import Thread

from klann_ros.cli import ArgumentParser, path
from klann_ros.live import Guard, new_token
from klann_ros.missing_package import install_command
from klann_ros.nodes.parameters import StartError
from klann_ros.nodes.process import arguments, Finish, ProcessNode, run
from klann_ros.sanitize.text import printable
from klann_ros.stop_signals import StopSignals
from klann_ros.web import open_browser

DESCRIPTION = """\
Show the legs that publish in a browser, live: the pose, the foot, charts, diagnostics, rates.
It prints one URL, which lets its user turn the crank, change lengths, steer a walker, and
press the buttons of a recorder and a player."""
EPILOG = """\
It listens on this machine only, unless --host names another address. The URL holds a
session token: without it a page is read-only, and another machine gets no page at all. The
connection is not encrypted: over a foreign network use ssh -L 8321:127.0.0.1:8321 MACHINE.
A page drives only after its button was pressed; its drive stops within half a second when the page
is closed, hidden or disconnected."""
# Messages are taken in batches of this time, which no eye sees; at 1 kHz the browser has time
# for an eighth more frames than half of it does [s].
BATCH_PERIOD = 0.006


def main(argv: Sequence[str], stop: StopSignals) -> int:
    """Run the node; return its exit code."""
    options = arguments(_parser(), argv)
    if options.runs and not Path(options.runs).is_dir():
        print(f'view_node: --runs {printable(options.runs)} is no folder', file=sys.stderr)
        return 1
    try:
        import aiohttp  # noqa: F401, PLC0415 - an extra
    except ModuleNotFoundError:
        remedy = install_command('aiohttp', 'view')
        print(f'view_node: there is no Python module aiohttp here: {remedy}', file=sys.stderr)
        return 1
    return run(
        'view_node',
        lambda finish: ViewNode(options, finish),
        argv,
        stop,
        raw=True,
        batch_period=BATCH_PERIOD,
    )


class ViewNode(ProcessNode):
    """Serve the live page."""

    def __init__(self, options: argparse.Namespace, _: Finish) -> None:
        """Start the server; a StartError if the address cannot be used."""
        from klann_ros.live import LiveServer, ServerError  # noqa: PLC0415 - an extra

        from .live_state import LiveState  # noqa: PLC0415 - an extra

        # Read-only: it publishes nothing, its own log included.
        super().__init__('view_node', enable_rosout=not options.read_only)
        self._state = LiveState(self, read_only=options.read_only)
        guard = Guard(options.host, options.port, new_token(), options.read_only)
        try:
            self._server = LiveServer(
                guard, self._state, options.runs or '', self.get_logger().warning
            )
        except ServerError as error:
            self._state.close()
            raise StartError(str(error)) from error
        guard = self._server.guard
        print(guard.url, flush=True)
        if not guard.is_local:
            self.get_logger().warning(
                f'{printable(guard.host)} can be reached from other machines; anyone with the '
                f'address may {"look" if options.read_only else "drive"}'
            )
        self.get_logger().info(
            f'ready: the live page is on port {guard.port}{", read only" * options.read_only}'
        )
        if options.open:
            Thread(target=self._open, args=(guard.url,), name='browser', daemon=True).start()

    def close(self) -> int:
        """Stop the drives, then the server; return the exit code."""
        self._state.close()
        self._server.close()
        return 0

    def _open(self, url: str) -> None:
        if not open_browser(url):
            self.get_logger().warning('no browser here; open the address that was printed')


def _parser() -> argparse.ArgumentParser:
    parser = ArgumentParser('view_node', DESCRIPTION, EPILOG)
    add = parser.add_argument
    add('--port', type=_port, default=8321, metavar='PORT', help='0: any free one')
    add('--host', type=path, default='127.0.0.1', metavar='ADDRESS', help='where it listens')
    add('--open', action='store_true', help='open it in a browser')
    add('--read-only', action='store_true', help='publish, set and call nothing')
    add('--runs', type=path, metavar='DIR', help='list the runs in this folder, and review them')
    return parser


def _port(text: str) -> int:
    if not (text.isascii() and text.isdecimal() and len(text) <= 5 and int(text) < 2**16):
        raise argparse.ArgumentTypeError(f'{text} is refused: it must be within 0 .. 65535')
    return int(text)
