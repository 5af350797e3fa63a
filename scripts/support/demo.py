"""Three turns of the crank: solver, crank and recorder as processes on DDS; then the review."""

import argparse
from contextlib import ExitStack
from datetime import datetime, timezone
import os
from pathlib import Path
from shlex import quote
import tempfile
import time

from domain import own_world
from environment import DISTRIBUTIONS, environment, NEEDS
from processes import Command, CommandError, end, last_lines, pause, run, running
from source import ROOT

TURNS = 3
# It waits for the solver and the recorder before its first message, so the run starts clean.
CRANK = ('mode:=constant', f'revolutions:={TURNS}', 'rate:=200.0', 'min_subscribers:=2')
WALKER = ('--ros-args', '--params-file', ROOT / 'config' / 'walker6_two_motors.yaml')
# A simulated leg that was built with errors, seen by cameras; crank_node turns it.
BUILT = (
    *('--ros-args', '--params-file', ROOT / 'config' / 'sem104.yaml'),
    *('-p', f'built:={ROOT / "config" / "sem104_built.yaml"}'),
    *('-p', 'cameras:=true', '-p', 'camera_outliers:=0.01'),
)
TURNED = ('--ros-args', '-p', 'output:=crank_command', '-p', 'speed:=1.5')
# Writes only on a trigger by the page's button: a run of the last seconds.
KEEP = ('-p', f'output:={ROOT / "runs"}', '-p', 'pre_trigger:=20.0', '-p', 'judge:=false')
RECORDER = ('--ros-args', *KEEP)
# The live shows: the title, and the nodes with their arguments.
SHOWS: dict[str, tuple[str, dict[str, Command]]] = {
    'demo': ('A leg', {'solver_node': (), 'crank_node': (), 'recorder_node': RECORDER}),
    'demo --calibrate': (
        'A simulated leg, seen by cameras,',
        {
            'solver_node': (),
            'sim_node': BUILT,
            'crank_node': TURNED,
            'recorder_node': (*RECORDER, '-p', 'all_topics:=true'),
        },
    ),
    'demo --walk': (
        'A simulated robot',
        {
            'solver_node': WALKER,
            'walker_node': (*WALKER, '-p', 'use_imu:=true'),
            'sim_node': (*WALKER, '-p', 'linear:=0.1'),
            'recorder_node': RECORDER,
        },
    ),
}
# Three turns take three seconds; the rest is for discovery on slow machines [s].
TIMEOUT = 60.0


def main(arguments: list[str]) -> int:
    """Run the demo; return 0 if the turns are recorded, reviewed and drawn."""
    parser = argparse.ArgumentParser(
        prog='scripts/demo',
        description='Solve, record, review and draw three turns of the crank.',
    )
    parser.add_argument(
        '--view', action='store_true', help='show a leg in the browser until Ctrl-C'
    )
    parser.add_argument(
        '--walk', action='store_true', help='show a simulated walker in the browser until Ctrl-C'
    )
    parser.add_argument(
        '--calibrate',
        action='store_true',
        help='show a simulated leg with errors, its cameras and its calibration until Ctrl-C',
    )
    help_text = 'the distribution of ROS 2; default: the sourced one, else jazzy'
    parser.add_argument('--ros', choices=DISTRIBUTIONS, default='', help=help_text)
    options = parser.parse_args(arguments)
    if options.walk:
        return _view('demo --walk', options.ros)
    if options.calibrate:
        return _view('demo --calibrate', options.ros)
    if options.view:
        return _view('demo', options.ros)
    recording = ROOT / 'runs' / f'demo-{datetime.now(timezone.utc):%Y%m%dT%H%M%S.%fZ}'
    with (
        environment('demo', options.ros) as env,
        tempfile.TemporaryDirectory(prefix='klann_ros-') as work,
        own_world(Path(work)) as world,
    ):
        programs = env.folder / 'bin'
        variables = env.variables | world
        recording.parent.mkdir(exist_ok=True)
        print(f'Running solver, crank and recorder as three processes for {TURNS} turns ...')
        record_turns(recording, programs, variables, Path(work))
        report = review_page(recording, programs, variables, Path(work))
    run_path = os.path.relpath(recording)
    player = quote(os.path.relpath(programs / 'player_node'))
    review = quote(os.path.relpath(programs / 'review'))
    print(f"""
{report}

The leg made {TURNS} turns. Output:
  {run_path}.html    page for a browser: animated leg and charts
  {run_path}    recorded run (MCAP; also for Foxglove and ros2 bag)
Play it back:      {player} {quote(run_path)}
Review it again:   {review} {quote(run_path)}""")
    return 0


def _view(show: str, ros: str) -> int:
    """Show a moving leg or walker in a browser; return 0 after Ctrl-C."""
    title, arguments = SHOWS[show]
    with (
        environment(show if show in NEEDS else 'demo', ros) as env,
        tempfile.TemporaryDirectory(prefix='klann_ros-') as work,
        own_world(Path(work)) as world,
        ExitStack() as stack,
    ):
        programs = env.folder / 'bin'
        variables = env.variables | world
        outputs = {name: Path(work, f'{name}.txt') for name in arguments}
        nodes = []
        for name, output in outputs.items():
            node = running([programs / name, *arguments[name]], variables, output)
            nodes.append(stack.enter_context(node))
        (ROOT / 'runs').mkdir(exist_ok=True)
        print(f'{title} moves; its page follows. Ctrl-C ends it.', flush=True)
        view = [programs / 'view_node', '--port', '0', '--open', '--runs', ROOT / 'runs']
        nodes.append(stack.enter_context(running(view, variables)))
        try:
            while all(node.poll() is None for node in nodes):
                pause()
        except CommandError:
            return 0
        last = [last_lines(output, 3) for output in outputs.values()]
        raise CommandError('\n'.join(['a node has ended', *last]))


def record_turns(recording: Path, programs: Path, variables: dict[str, str], work: Path) -> None:
    """Record the turns; then end the other two processes as by Ctrl-C."""
    recorder = (f'output:={recording}',)
    parameters = {'crank_node': CRANK, 'recorder_node': recorder, 'solver_node': ()}
    outputs = {name: work / f'{name}.txt' for name in parameters}
    with ExitStack() as stack:
        nodes = {}
        for name, assignments in parameters.items():
            command: list[object] = [programs / name, '--ros-args']
            for assignment in assignments:
                command += ['-p', assignment]
            node = running(command, variables, outputs[name])
            nodes[name] = stack.enter_context(node)
        deadline = time.monotonic() + TIMEOUT
        while all(node.poll() is None for node in nodes.values()) and time.monotonic() < deadline:
            pause()
        has_turned = nodes['crank_node'].poll() == 0
        # The last answers are still in transport.
        pause(0.5)
        codes = {name: end(node) for name, node in nodes.items()}
        pause(0)
    if not has_turned or any(codes.values()):
        lines = ['the crank did not finish its turns']
        for name, code in codes.items():
            lines.append(f'{name} ended with {code}: {last_lines(outputs[name], 12)}')
        raise CommandError('\n'.join(lines))


def review_page(recording: Path, programs: Path, variables: dict[str, str], work: Path) -> str:
    """Return the report of `review`, which also writes the page."""
    # Beside the run: its folder holds recorded data only.
    command = [programs / 'review', recording, '--html', f'{recording}.html']
    output = work / 'review.txt'
    code = run(command, variables, output, TIMEOUT)
    # A finding, such as a gap on a busy machine, is a valid report.
    if code not in (0, 1) or not Path(f'{recording}.html').is_file():
        raise CommandError(f'review failed: {last_lines(output, 12)}')
    return last_lines(output, 1000)
