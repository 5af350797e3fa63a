"""The browser that the review's page is tested in: the machine's own, or one brought for it."""

import os
from pathlib import Path
import shutil
import subprocess
import sys

from environment import Environment
from processes import Command, run

# First the one without what only a window needs: the tests take half of the time.
SHELL = 'chromium-headless-shell'
NAMES = (SHELL, 'chromium', 'chromium-browser', 'google-chrome', 'google-chrome-stable')
# Debian's, the second where it is too old for the first; Ubuntu's are but ways to snap.
PACKAGES = (SHELL, 'chromium')
# For a machine that has no letters.
FONTS = 'fonts-dejavu-core'
APT = ('apt-get', '-qq', '--yes')
# A mirror that hangs must not keep the tests from running [s].
TIMEOUT = 300.0


def find(prefix: Path = Path(sys.prefix)) -> str | None:
    """Return a Chromium that starts: the machine's own, else Playwright's in an environment."""
    brought = prefix.glob('browsers/*/*/*headless?shell')
    for path in (*filter(None, map(shutil.which, NAMES)), *map(str, brought)):
        # Ubuntu's chromium-browser may be but a text; Playwright's may miss libraries.
        answer = subprocess.run([path, '--version'], capture_output=True, check=False)
        if answer.returncode == 0:
            return path
    return None


def provide(env: Environment, work: Path) -> str | None:
    """Bring a browser if there is none; return what to do if none can be brought."""
    if find(env.folder):
        return None
    playwright = [env.python, '-m', 'playwright', 'install', '--only-shell', 'chromium']
    ways: dict[str, list[Command]] = {'Playwright': [playwright]}
    if os.geteuid() == 0 and shutil.which('apt-get'):
        install = [*APT, '--no-install-recommends', 'install', FONTS]
        ways |= {f'apt-get of {name}': [[*APT, 'update'], [*install, name]] for name in PACKAGES}
    variables = env.variables | {'DEBIAN_FRONTEND': 'noninteractive'}
    variables['PLAYWRIGHT_BROWSERS_PATH'] = str(env.folder / 'browsers')
    for name, commands in ways.items():
        print(f'No Chromium: {name} installs one, once, for the tests of the page ...')
        log = work / 'browser.txt'
        done = all(run(command, variables, log, TIMEOUT) == 0 for command in commands)
        if find(env.folder):
            return None
        lines = log.read_text(encoding='utf-8', errors='replace').splitlines()
        errors = [line for line in lines if line.startswith(('Error', 'E:'))]
        reason = (errors or ['no reason given'])[0]
        print(f'... {name} failed: {"what it installed does not start" if done else reason}')
    return 'no Chromium for the tests of the page: apt install chromium, or put Chrome into PATH'
