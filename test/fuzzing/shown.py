"""What is said of a log: letters that can be seen, in lines that are its author's own."""

from fuzzing.hostile import FORGED


def hold(text, case, *, colours=False):
    """Hold all that was printed to the law: nothing moves the terminal, and no line is forged."""
    shown = text
    if colours:
        for code in ('1;31', '1;33', '36', '1;32', '1', '2', '0'):
            shown = shown.replace(f'\x1b[{code}m', '')
    odd = sorted({letter for letter in shown if not letter.isprintable()} - {'\n'})
    assert not odd, f'{case}: it says {odd!r}'
    forged = [line for line in shown.splitlines() if line.lstrip().startswith(FORGED)]
    assert not forged, f'{case}: {forged[0]}'
