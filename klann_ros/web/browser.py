"""Open a page in the user's browser, if there is one, or print it."""

import os
from pathlib import Path
import shutil
import subprocess
import sys
from tempfile import TemporaryDirectory
import webbrowser

# One of these is set if there is a screen, or if the user has named a browser.
_SCREEN_VARIABLES = ('DISPLAY', 'WAYLAND_DISPLAY', 'BROWSER')
# Programs that print, and the time for one page [s].
_CHROMIUMS = (
    *('chromium', 'chromium-browser', 'google-chrome', 'google-chrome-stable'),
    'chromium-headless-shell',
)
_MAX_PRINTING = 300.0


def open_browser(url: str) -> bool:
    """
    Open an address in a browser; return whether there is one.

    Without a screen none is started: one in the terminal would hide what the program prints.
    """
    if sys.platform == 'linux' and not any(os.environ.get(name) for name in _SCREEN_VARIABLES):
        return False
    try:
        return webbrowser.open(url)
    except (OSError, webbrowser.Error):
        return False


class PrintError(Exception):
    """A page cannot be printed: no Chromium, or it failed."""


def print_page(page: bytes) -> bytes:
    """
    Return an HTML page as PDF, printed by a Chromium of this machine.

    Raises a PrintError if there is none, or it fails.
    """
    program = next(filter(None, map(shutil.which, _CHROMIUMS)), None)
    if program is None:
        raise PrintError(f'a PDF needs {_CHROMIUMS[0]}: install it, or print the HTML page')
    # Chromium refuses its sandbox to root.
    flags = ['--no-sandbox'] if hasattr(os, 'geteuid') and os.geteuid() == 0 else []
    with TemporaryDirectory() as folder:
        source, target = Path(folder, 'page.html'), Path(folder, 'page.pdf')
        source.write_bytes(page)
        profile = f'--user-data-dir={folder}/profile'
        output = [f'--print-to-pdf={target}', '--no-pdf-header-footer', source.as_uri()]
        command = [program, '--headless', '--disable-gpu', profile, *flags, *output]
        try:
            ended = subprocess.run(  # noqa: S603 - our own page and flags
                command, capture_output=True, check=False, timeout=_MAX_PRINTING
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            raise PrintError(f'{program} failed: {error}') from error
        if ended.returncode or not target.exists():
            raise PrintError(f'{program} failed with exit code {ended.returncode}')
        return target.read_bytes()
