"""Charts: quantities over a turn of the crank, and the convergence of Newton-Raphson."""

from collections.abc import Callable, Sequence
from math import radians
from typing import Any, NamedTuple, TYPE_CHECKING

from klann_ros.kinematics import (
    AnyLeg,
    colour_of,
    COLOURS,
    Iterations,
    LinkagePose,
    NoFootPathError,
)
from klann_ros.kinematics.angles import Arc, TURN
from klann_ros.kinematics.arrays import FloatArray
import numpy as np

from .plane import axes_of, axis_label, grid, leg_of, symbol

if TYPE_CHECKING:
    from matplotlib.axes import Axes

DEG = '°'
# Between the poses of a chart [rad].
CHART_STEP = radians(0.5)
# Recommended range of transmission angles [deg].
TRANSMISSION_RANGE = (40.0, 140.0)
MARKERS = 'os^DvP'


class _PoseQuantity(NamedTuple):
    """A quantity of a pose, with a curve for each of its numbers: symbol and colour."""

    curves: Callable[[AnyLeg], list[tuple[str, str]]]
    numbers: Callable[[LinkagePose], Sequence[float]]
    label: str = ''
    unit: str = ''


def _body_curves(leg: AnyLeg, *, slides: bool) -> list[tuple[str, str]]:
    """Return the curves of the bodies but the crank that slide, or turn."""
    bodies = [*enumerate(leg.linkage.structure.bodies)][1:]
    return [(symbol(body.angle), colour_of(j)) for j, body in bodies if body.slides == slides]


def _coordinates(pose: LinkagePose, *, slides: bool) -> list[float]:
    coordinates = zip(pose.linkage.structure.bodies[1:], pose.x, strict=True)
    return [x for body, x in coordinates if body.slides == slides]


def _block_curves(leg: AnyLeg) -> list[tuple[str, str]]:
    """Return the curves of the transmission angles, one for each block."""
    groups = leg.linkage.structure.groups
    if len(groups) == 1:
        return [(r'$\mu$', colour_of(groups[0][0]))]
    return [(rf'$\mu_{{{k}}}$', colour_of(group[0])) for k, group in enumerate(groups, 1)]


QUANTITIES = {
    'angles': _PoseQuantity(
        lambda leg: _body_curves(leg, slides=False),
        lambda pose: _coordinates(pose, slides=False),
        unit=DEG,
    ),
    'distances': _PoseQuantity(
        lambda leg: _body_curves(leg, slides=True),
        lambda pose: _coordinates(pose, slides=True),
        unit='m',
    ),
    'transmission': _PoseQuantity(
        _block_curves, lambda pose: pose.transmission_angles, r'$\mu$', DEG
    ),
    'condition': _PoseQuantity(
        lambda _: [(r'cond $\Phi$', colour_of(0))], lambda pose: (pose.condition,)
    ),
    'foot': _PoseQuantity(
        lambda _: [('x', colour_of(1)), ('y', colour_of(0))], lambda pose: pose.h, unit='m'
    ),
}


def plot_turn(linkage: Any, what: str = 'angles', *, ax: 'Axes | None' = None) -> 'Axes':
    """
    Draw a quantity over a turn of the crank, or over its reachable arcs.

    A linkage with change points that is back after several turns has them all.

    Parameters
    ----------
    linkage : Linkage, KlannGeometry, FourBarGeometry or leg
        The linkage.
    what : str
        'angles', of every body but the crank, unwrapped; 'distances', of every sliding body;
        'transmission', the transmission angle of each block, over the recommended band from 40 to
        140 deg; 'condition', the condition number of Phi; 'foot', the foot's coordinates.
    ax : matplotlib.axes.Axes, optional
        The axes; by default the axes of a new figure.

    Returns
    -------
    matplotlib.axes.Axes
        The axes: crank angles in degrees along x, and a line for each quantity, with its symbol.

    Raises
    ------
    ValueError
        The quantity is unknown, or there is no sliding body.
    NoFootPathError
        The crank reaches no angle.

    """
    if what not in QUANTITIES:
        raise ValueError(f'what = {what!r} is refused: it must be one of {", ".join(QUANTITIES)}')
    leg = leg_of(linkage)
    quantity = QUANTITIES[what]
    curves = quantity.curves(leg)
    if not curves:
        raise ValueError(f'what = {what!r} is refused: the linkage has no {what}')
    arcs = leg.path_arcs()
    if not arcs:
        raise NoFootPathError
    alphas, numbers = _over_arcs(leg, quantity, arcs, unwrapped=what == 'angles')
    ax = axes_of(ax)
    from matplotlib.ticker import MaxNLocator  # noqa: PLC0415 - as in `axes_of`

    if what == 'transmission':
        ax.axhspan(*TRANSMISSION_RANGE, color=COLOURS[2], alpha=0.15, linewidth=0)
        ax.set(ylim=(0.0, 180.0), yticks=sorted((0.0, 90.0, 180.0, *TRANSMISSION_RANGE)))
    for (name, colour), curve in zip(curves, numbers.T, strict=True):
        ax.plot(alphas, curve, color=colour, label=name)
    label = quantity.label or ', '.join(name for name, _ in curves)
    unit = leg.linkage.structure.unit if quantity.unit == 'm' else quantity.unit
    ax.set(xlabel=f'{symbol(leg.joint_names[0])} / {DEG}', ylabel=axis_label(label, unit))
    ax.xaxis.set_major_locator(MaxNLocator('auto', steps=[1, 3, 4.5, 6, 9, 10]))
    if arcs[0][1] - arcs[0][0] >= TURN:
        ax.set(xlim=np.degrees(arcs[0]))
    grid(ax)
    return ax


def plot_convergence(
    linkage: Any,
    alpha: float,
    guess: Sequence[float],
    what: str = 'errors',
    *,
    ax: 'Axes | None' = None,
    **stop: Any,
) -> 'Axes':
    """
    Draw the convergence of the textbook's Newton-Raphson from a guess: a line for each block.

    Parameters
    ----------
    linkage : Linkage, KlannGeometry, FourBarGeometry or leg
        The linkage.
    alpha : float
        Crank angle [rad].
    guess : sequence of float
        The other angles of the first iterate, as of `Leg.newton` [rad].
    what : str
        'errors', of each iterate x_k against the last, x; 'corrections', to the next iterate;
        each the greatest of a block's angles [rad] and distances [m]; or 'residuals', the norm of
        a block's loop equations at each iterate [m].
    ax : matplotlib.axes.Axes, optional
        The axes; by default the axes of a new figure.
    **stop
        Stopping criteria: keywords of `Leg.newton`, such as `max_iterations`.

    Returns
    -------
    matplotlib.axes.Axes
        The axes: k = 1, 2, ... along x, a logarithmic scale along y. A value of 0 is not drawn.

    Raises
    ------
    NotConvergedError
        Newton-Raphson finds no pose; it carries the iterates.
    ValueError
        There is no such quantity, or the guess is refused.

    """
    if what not in CONVERGENCE:
        raise ValueError(f'what = {what!r} is refused: it must be one of {", ".join(CONVERGENCE)}')
    leg = leg_of(linkage)
    structure = leg.linkage.structure
    measure = CONVERGENCE[what]
    unit = structure.unit if measure.unit == 'm' else measure.unit
    if unit == 'rad' and structure.slides:
        unit = 'rad, m'
    table = measure.table(leg.iterations(alpha, guess, **stop))
    ax = axes_of(ax)
    from matplotlib.ticker import MaxNLocator  # noqa: PLC0415 - as in `axes_of`

    for k, group in enumerate(structure.groups):
        if what == 'residuals':
            # Two equations of each loop.
            loops = np.array(structure.paths.rows[k])
            equations = np.stack([2 * loops, 2 * loops + 1], axis=1).ravel()
            curve = np.linalg.norm(table[:, equations], axis=1)
        else:
            curve = np.abs(table[:, [j - 1 for j in group]]).max(axis=1)
        name = ', '.join(symbol(leg.joint_names[j]) for j in group)
        positive = np.where(curve > 0.0, curve, np.nan)
        style = f'{MARKERS[k % len(MARKERS)]}-'
        numbers = 1 + np.arange(len(curve))
        ax.semilogy(numbers, positive, style, color=colour_of(group[0]), label=name)
    ax.set(xlabel='$k$', ylabel=axis_label(measure.label, unit))
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    grid(ax)
    return ax


class _Convergence(NamedTuple):
    """A measure of convergence: its numbers by the iterates, its label and its unit."""

    table: Callable[[Iterations], FloatArray]
    label: str
    unit: str


CONVERGENCE = {
    'errors': _Convergence(lambda run: run.x[:-1] - run.x[-1], '$|x_k - x|$', 'rad'),
    'corrections': _Convergence(lambda run: run.corrections, '$|x_{k+1} - x_k|$', 'rad'),
    'residuals': _Convergence(lambda run: run.f, '$|f(x_k)|$', 'm'),
}


def _over_arcs(
    leg: AnyLeg, quantity: _PoseQuantity, arcs: list[Arc], *, unwrapped: bool
) -> tuple[FloatArray, FloatArray]:
    """Return crank angles [deg] and a quantity's numbers, shape (n, k); NaN between arcs."""
    alphas = []
    numbers = []
    for start, end in arcs:
        arc = np.linspace(start, end, max(2, 1 + round((end - start) / CHART_STEP)))
        poses = map(leg.closed_form, arc.tolist())
        arc_numbers = np.array([quantity.numbers(pose) for pose in poses])
        if unwrapped:
            arc_numbers = np.unwrap(arc_numbers, axis=0)
        gap = np.full_like(arc_numbers[:1], np.nan)
        alphas += [np.array([np.nan]), np.degrees(arc)]
        numbers += [gap, arc_numbers]
    scale = np.degrees(1.0) if quantity.unit == DEG else 1.0
    return np.concatenate(alphas[1:]), scale * np.concatenate(numbers[1:])
