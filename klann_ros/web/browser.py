"""Open a page in the user's browser, if there is one."""

import os
import sys
import webbrowser

# Where one of these is set, there is a screen, or somebody has named a browser.
_SCREENS = ('DISPLAY', 'WAYLAND_DISPLAY', 'BROWSER')


def is_opened(url: str) -> bool:
    """
    Open an address in a browser; return whether there is one.

    One that takes over the terminal is none: there, something else is being said.
    """
    if sys.platform == 'linux' and not any(os.environ.get(name) for name in _SCREENS):
        return False
    try:
        return webbrowser.open(url)
    except (OSError, webbrowser.Error):
        return False
