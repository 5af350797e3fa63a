"""The browser of the page tests: the machine's own, or an installed one."""

import os
from pathlib import Path
import shutil
import subprocess
import sys

from environment import Environment
from processes import Command, run

# The headless shell first: it halves the time of the tests.
SHELL = 'chromium-headless-shell'
NAMES = (SHELL, 'chromium', 'chromium-browser', 'google-chrome', 'google-chrome-stable')
# Debian's, the second where it is too old for the first; Ubuntu's are but ways to snap.
PACKAGES = (SHELL, 'chromium')
# For a machine without fonts.
FONTS = 'fonts-dejavu-core'
APT = ('apt-get', '-qq', '--yes')
# A hanging mirror must not block the tests [s].
TIMEOUT = 300.0


def find(prefix: Path = Path(sys.prefix)) -> str | None:
    """Return a Chromium that starts: the machine's own, else Playwright's in an environment."""
    machine_paths = filter(None, map(shutil.which, NAMES))
    installed_paths = map(str, prefix.glob('browsers/*/*/*headless?shell'))
    for path in (*machine_paths, *installed_paths):
        # Ubuntu's chromium-browser may be a stub; Playwright's may miss libraries.
        answer = subprocess.run([path, '--version'], capture_output=True, check=False)
        if answer.returncode == 0:
            return path
    return None


def provide(env: Environment, work: Path) -> str | None:
    """Install a browser if there is none; return advice if that fails."""
    if find(env.folder):
        return None
    playwright = [env.python, '-m', 'playwright', 'install', '--only-shell', 'chromium']
    installers: dict[str, list[Command]] = {'Playwright': [playwright]}
    if os.geteuid() == 0 and shutil.which('apt-get'):
        install = [*APT, '--no-install-recommends', 'install', FONTS]
        for name in PACKAGES:
            installers[f'apt-get of {name}'] = [[*APT, 'update'], [*install, name]]
    variables = env.variables | {'DEBIAN_FRONTEND': 'noninteractive'}
    variables['PLAYWRIGHT_BROWSERS_PATH'] = str(env.folder / 'browsers')
    for name, commands in installers.items():
        print(f'No Chromium: {name} installs one, once, for the tests of the page ...')
        log = work / 'browser.txt'
        is_done = all(run(command, variables, log, TIMEOUT) == 0 for command in commands)
        if find(env.folder):
            return None
        lines = log.read_text(encoding='utf-8', errors='replace').splitlines()
        errors = [line for line in lines if line.startswith(('Error', 'E:'))]
        reason = (errors or ['no reason given'])[0]
        print(f'... {name} failed: {"what it installed does not start" if is_done else reason}')
    return 'no Chromium for the tests of the page: apt install chromium, or put Chrome into PATH'
