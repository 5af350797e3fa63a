"""
Two discs and a bar: the exercise at the end of SEM 104, lecture 7.

A disc turning about A drives a disc about D through the bar BC. The angles of the bar and of the
second disc over a turn of the first are computed by Newton-Raphson and by the geometric method,
and compared.
"""

import argparse
from collections.abc import Sequence
import math
from pathlib import Path
import sys
from typing import NamedTuple

from klann_ros.kinematics import FourBar
import numpy as np

# R_AB, L_BC, L_AD and R_DC of the exercise [m]: a four-bar with the ground AD and the coupler BC.
R_AB, L_BC, L_AD, R_DC = 0.100, 0.500, 0.500, 0.120
DISCS = FourBar(ground=L_AD, crank=R_AB, coupler=L_BC, rocker=R_DC)


class Turn(NamedTuple):
    """
    A turn of the first disc.

    Attributes
    ----------
    ab : numpy.ndarray, shape (n,)
        Angles of the first disc [rad].
    newton, geometric : numpy.ndarray, shape (n, 2)
        Angles of the bar BC and of the disc DC by each method, without jumps of 2 pi [rad].

    """

    ab: np.ndarray
    newton: np.ndarray
    geometric: np.ndarray

    @property
    def differences(self) -> np.ndarray:
        """Return Newton-Raphson less geometric, shape (n, 2) [rad]."""
        return np.array(
            [
                [math.remainder(a - b, 2.0 * math.pi) for a, b in zip(*rows, strict=True)]
                for rows in zip(self.newton, self.geometric, strict=True)
            ]
        )


def main(arguments: Sequence[str]) -> int:
    """Print the table, draw the figure if asked to; return the exit code."""
    options = parse(arguments)
    turn = solve(options.step)
    print(table(turn))
    print(f'greatest difference: {np.abs(turn.differences).max():.1e} rad')
    if options.plot is None:
        return 0
    try:
        plot(turn, options.plot)
    except ImportError:
        print('--plot needs matplotlib: pip install matplotlib', file=sys.stderr)
        return 1
    except (OSError, ValueError) as error:
        print(f'{options.plot} cannot be written: {error}', file=sys.stderr)
        return 1
    return 0


def parse(arguments: Sequence[str]) -> argparse.Namespace:
    """Return the options."""
    parser = argparse.ArgumentParser(
        description='The two discs of SEM 104: angles of the bar BC and of the disc DC over a '
        'turn of the disc AB, by Newton-Raphson and by the geometric method.'
    )
    parser.add_argument('--plot', type=Path, metavar='FILE.png', help='draw the angles')
    parser.add_argument(
        '--step', type=step, default=1.0, metavar='DEG', help='step of the disc AB (default: 1)'
    )
    return parser.parse_args(arguments)


def step(text: str) -> float:
    """Return a step of the first disc [deg]."""
    degrees = float(text)
    if not 0.01 <= degrees <= 90.0:
        raise argparse.ArgumentTypeError('it must be within 0.01 .. 90 deg')
    return degrees


def solve(step: float) -> Turn:
    """Return a turn in steps [deg], by both methods."""
    ab = np.radians(np.linspace(0.0, 360.0, round(360.0 / step) + 1))
    newton = [DISCS.solve(angle).x for angle in ab]
    geometric = [DISCS.closed_form(angle).x for angle in ab]
    return Turn(ab, np.unwrap(newton, axis=0), np.unwrap(geometric, axis=0))


def table(turn: Turn) -> str:
    """Return the angles at about every 30 deg, and the difference of the two methods there."""
    lines = [
        'angles in deg; Newton-Raphson, and its difference from the geometric method in rad',
        f'{"AB":>7} {"bar BC":>10} {"disc DC":>10} {"d(BC)":>9} {"d(DC)":>9}',
    ]
    every = max(1, (len(turn.ab) - 1) // 12)
    for ab, x, d in list(zip(turn.ab, turn.newton, turn.differences, strict=True))[::every]:
        bc, dc = np.degrees(x)
        lines.append(f'{math.degrees(ab):7.2f} {bc:10.4f} {dc:10.4f} {d[0]:9.1e} {d[1]:9.1e}')
    return '\n'.join(lines)


def plot(turn: Turn, path: Path) -> None:
    """Draw both angles against that of the first disc, and the difference of the methods."""
    from klann_ros.plotting import plot_turn  # noqa: PLC0415 - optional
    from matplotlib.figure import Figure  # noqa: PLC0415 - see above

    figure = Figure(figsize=(8, 7), layout='constrained')
    upper, lower = figure.subplots(2, sharex=True, height_ratios=(3, 2))
    plot_turn(DISCS, ax=upper)
    ab, dots = np.degrees(turn.ab), slice(None, None, max(1, len(turn.ab) // 36))
    for k, (line, name) in enumerate(zip(upper.get_lines(), ('bar BC', 'disc DC'), strict=True)):
        newton, style = np.degrees(turn.newton[dots, k]), {'color': line.get_color()}
        line.set_label(f'{name}, geometric')
        upper.plot(ab[dots], newton, 'o', mfc='none', label=f'{name}, Newton-Raphson', **style)
        lower.plot(ab, turn.differences[:, k], '.-', lw=0.5, ms=3, label=name, **style)
    upper.set_title(
        f'Two discs: R_AB {R_AB * 1e3:g}, L_BC {L_BC * 1e3:g}, '
        f'L_AD {L_AD * 1e3:g}, R_DC {R_DC * 1e3:g} mm'
    )
    upper.set(xlabel='', ylabel='angle from AD [deg]')
    lower.set(ylabel='Newton-Raphson less geometric [rad]', xlabel='angle of the disc AB [deg]')
    lower.grid(alpha=0.3)
    for axes in (upper, lower):
        axes.legend()
    figure.savefig(path, dpi=120)


if __name__ == '__main__':
    sys.exit(main(sys.argv[1:]))
