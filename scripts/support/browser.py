"""The browser that the review's page is tested in: found, or installed where that is possible."""

import os
from pathlib import Path
import shutil

import processes

NAMES = ('chromium', 'chromium-browser', 'google-chrome', 'google-chrome-stable')
# Debian's, and letters for a machine that has none; Ubuntu's package is but a way to snap.
PACKAGES = ('chromium', 'fonts-dejavu-core')
# A mirror that hangs must not keep the tests from running.
TIMEOUT = 300.0


def find() -> str | None:
    """Return the path of a Chromium, None if there is none."""
    return next(filter(None, map(shutil.which, NAMES)), None)


def provide(work: Path) -> None:
    """Install Debian's Chromium if there is none, we may, and apt-get is here."""
    if find() or os.geteuid() != 0 or not shutil.which('apt-get'):
        return
    print('Installing Chromium by apt-get, once, for the tests of the page ...')
    variables = {**os.environ, 'DEBIAN_FRONTEND': 'noninteractive'}
    for arguments in (
        ('update', '-qq'),
        ('install', '-qq', '--yes', '--no-install-recommends', *PACKAGES),
    ):
        output = work / 'apt-get.txt'
        if processes.run(['apt-get', *arguments], output, variables, work, TIMEOUT) != 0:
            said = output.read_text(encoding='utf-8', errors='replace').strip().splitlines()
            print(f'... apt-get {arguments[0]} failed: {said[-1] if said else "no output"}')
            return
