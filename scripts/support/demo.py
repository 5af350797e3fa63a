"""Three turns of the crank: solver, crank and recorder as processes on DDS; then the review."""

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import datetime, timezone
import os
from pathlib import Path
import tempfile
import time

from command_error import CommandError
from domain import own_domain
from environment import Environment, environment
import processes
from source import ROOT
import stop

TURNS = 3
CRANK = (
    'mode:=constant',
    f'revolutions:={TURNS}',
    'rate:=200.0',
    # Its first message waits for the solver and the recorder: then the run has no ragged start.
    'min_subscribers:=2',
)
# Three turns take three seconds; the rest is for slow machines to find each other.
TIMEOUT = 60.0
LAST_LINES = 12


class Stage:
    """The processes of one run and what they print."""

    def __init__(self, env: Environment, work: Path, domain: int) -> None:
        self._bin = env.folder / 'bin'
        self._work = work
        self._variables = env.variables | {
            'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
            'ROS_DOMAIN_ID': str(domain),
            'ROS_LOG_DIR': str(work / 'ros-log'),
        }
        self._running: dict[str, processes.Process] = {}

    def start(self, name: str, *parameters: str) -> None:
        """Start a node with parameters such as 'rate:=200.0'."""
        ros_arguments = [word for parameter in parameters for word in ('-p', parameter)]
        if parameters:
            ros_arguments.insert(0, '--ros-args')
        command: list[str | Path] = [self._bin / name, *ros_arguments]
        self._running[name] = processes.start(
            command, self._output(name), self._variables, self._work
        )

    def wait_for(self, name: str) -> None:
        """Wait until a node has done its job, while all others go on with theirs."""
        deadline = time.monotonic() + TIMEOUT
        while self._running[name].poll() is None:
            for other, process in self._running.items():
                if other != name and process.poll() is not None:
                    raise self._died(other, process.returncode)
            if time.monotonic() > deadline:
                raise CommandError(f'{name} did not finish in {TIMEOUT:.0f} s{self._said(name)}')
            stop.pause()
        self.finish(name)

    def finish(self, name: str) -> None:
        """End a node with SIGINT, as Ctrl-C does, and insist on exit code 0."""
        code = processes.end(self._running.pop(name))
        stop.check()
        if code:
            raise self._died(name, code)

    def review(self, run: Path, picture: Path, page: Path) -> str:
        """Return what `review` says about the run; it draws the picture and the page, too."""
        output = self._output('review')
        command: list[str | Path] = [self._bin / 'review', run]
        command += ['--picture', picture, '--html', page]
        code = processes.run(command, output, self._variables, ROOT, TIMEOUT)
        # A finding, such as a gap on a machine that is busy, is told as any other.
        if code not in (0, 1) or not (picture.is_file() and page.is_file()):
            what = f'review came to nothing (exit code {code})'
            raise CommandError(what + self._said('review'))
        return output.read_text(encoding='utf-8').strip()

    def clear(self) -> None:
        """End whatever still runs."""
        for process in self._running.values():
            processes.end(process)

    def _output(self, name: str) -> Path:
        return self._work / f'{name}.txt'

    def _died(self, name: str, code: int) -> CommandError:
        return CommandError(f'{name} ended with exit code {code}{self._said(name)}')

    def _said(self, name: str) -> str:
        text = self._output(name).read_text(encoding='utf-8', errors='replace').strip()
        if not text:
            return ' and said nothing'
        return '; it said last:\n' + '\n'.join(f'    {s}' for s in text.splitlines()[-LAST_LINES:])


@contextmanager
def _stage(env: Environment) -> Iterator[Stage]:
    with tempfile.TemporaryDirectory(prefix='klann_ros-') as work, own_domain() as domain:
        stage = Stage(env, Path(work), domain)
        try:
            yield stage
        finally:
            stage.clear()


def main(arguments: list[str]) -> int:
    """Run the demo; return 0 if the leg walked, the run is good and the picture is drawn."""
    argparse.ArgumentParser(
        prog='scripts/demo',
        description='Three turns of the crank: solved, recorded, reviewed, drawn.',
    ).parse_args(arguments)
    with environment('demo') as env:
        run = _new_run()
        print(f'Solver, crank and recorder run as three processes for {TURNS} turns ...')
        with _stage(env) as stage:
            stage.start('solver_node')
            stage.start('recorder_node', f'output:={run}')
            stage.start('crank_node', *CRANK)
            stage.wait_for('crank_node')
            # The last answers are still on their way to the recorder.
            stop.pause(0.5)
            stage.finish('recorder_node')
            stage.finish('solver_node')
            # Beside the run: nothing but what was recorded is in its folder.
            page, picture = (run.with_name(f'{run.name}.{kind}') for kind in ('html', 'png'))
            said = stage.review(run, picture, page)
        _report(env, run, said)
    return 0


def _new_run() -> Path:
    """Return a name for the run's folder, which the recorder makes itself."""
    runs = ROOT / 'runs'
    try:
        runs.mkdir(exist_ok=True)
    except OSError as error:
        raise CommandError(f'cannot make {runs}: {error.strerror}') from error
    if not os.access(runs, os.W_OK):
        raise CommandError(f'cannot write to {runs}')
    return runs / f'demo-{datetime.now(timezone.utc):%Y%m%dT%H%M%S.%fZ}'


def _report(env: Environment, run: Path, said: str) -> None:
    folder, programs = _from_here(run), _from_here(env.folder / 'bin')
    print(f"""
{said}

The leg walked {TURNS} turns. What there is now:
  {folder}.html    open it in a browser: the leg, animated, and its charts
  {folder}.png    a picture: the leg and the path of its foot
  {folder}    the recorded run (MCAP; also for Foxglove and ros2 bag)
Play it back:      {programs}/player_node {folder}
Look at it again:  {programs}/review {folder}""")


def _from_here(path: Path) -> str:
    """Return a path as one would type it here."""
    try:
        return str(path.relative_to(Path.cwd()))
    except (OSError, ValueError):
        return str(path)
