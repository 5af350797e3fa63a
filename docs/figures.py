"""
Make the documentation's figures with the package's own code: python docs/figures.py [FOLDER].

They hold letters, symbols, units and names but no words, so that the pages of both languages share
them.
"""

from collections.abc import Callable, Iterable, Sequence
import math
from pathlib import Path
import sys

from klann_ros.kinematics import foot_path, FourBar, KlannLeg, LinkageLeg, shipped_linkage
from klann_ros.kinematics.drawing import COLOURS
from klann_ros.kinematics.linkage.dyads import dyad_joint
from klann_ros.plotting import plot_convergence, plot_foot_path, plot_pose, plot_turn
from klann_ros.plotting.plane import draw_angle, GREY, grid, label_plane, PALE_BLUE
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, FancyArrowPatch, FancyBboxPatch
import numpy as np

FOLDER = Path(__file__).resolve().parent
RED, BLUE, GREEN, YELLOW, NAVY, *_ = COLOURS
DEG = '°'
Point = Sequence[float]

# The four-bars of the course and of the task with two discs, L1 to L4 [m].
EXAMPLE = (0.180, 0.080, 0.200, 0.150)
EXERCISE = (0.300, 0.100, 0.250, 0.200)
DISCS = (0.500, 0.100, 0.500, 0.120)
# A four-bar of class II, for dead points of the crank.
TRIPLE_ROCKER = (0.180, 0.120, 0.130, 0.140)


def legend_beside(axes: Axes) -> None:
    """Draw the legend to the right of the axes."""
    axes.legend(fontsize='small', frameon=False, loc='center left', bbox_to_anchor=(1.0, 0.5))


def klann_leg() -> Figure:
    """Return the leg of SEM 104 at a crank angle of 60 deg, with its letters and angles."""
    leg = KlannLeg()
    figure = Figure(figsize=(8.0, 5.6), layout='constrained')
    axes = plot_foot_path(leg, ax=figure.add_subplot())
    plot_pose(leg, math.radians(60.0), ax=axes, angles=True)
    bodies = leg.linkage.structure.bodies
    names = {body.label: ''.join(body.points) for body in bodies}
    for line in axes.get_lines():
        line.set_label(names.get(line.get_label(), line.get_label()))
    axes.set_title(rf'$\alpha$ = 60{DEG}')
    legend_beside(axes)
    return figure


def newton_convergence() -> Figure:
    """Return the error of Newton-Raphson's iterates, and of each against the one before."""
    alpha = math.radians(60.0)
    figure = Figure(figsize=(8.0, 3.8), layout='constrained')
    left, right = figure.subplots(1, 2)
    plot_convergence(KlannLeg(), alpha, np.radians([15.0, 60.0, 45.0, 60.0]), ax=left)
    plot_convergence(FourBar(*EXAMPLE), alpha, np.radians([15.0, 80.0]), ax=left)
    left.lines[-1].set(color=RED, marker='^')
    for line in left.lines:
        errors, look = line.get_ydata(), {'marker': line.get_marker(), 'color': line.get_color()}
        # What is left in the end is rounding.
        clear = errors[1:] > 1e-15
        right.loglog(errors[:-1][clear], errors[1:][clear], ls='', label=line.get_label(), **look)
    left.axhline(1e-12, linestyle=':', color=GREY)
    left.annotate(r'$10^{-12}$', (1.0, 2e-12), color=GREY)
    e = np.array([3e-8, 1.0])
    for factor, style in ((1.0, '-'), (0.1, ':')):
        right.loglog(e, factor * e**2, style, color=PALE_BLUE, zorder=0)
    right.annotate('$e^2$', (2e-5, 3e-9), color=GREY, ha='right')
    right.annotate('$e^2/10$', (2e-4, 6e-10), color=GREY)
    right.set(xlabel=r'$e_k$ / rad', ylabel=r'$e_{k+1}$ / rad')
    grid(right)
    for axes in (left, right):
        axes.legend(frameon=False)
    return figure


def klann_turn() -> Figure:
    """Return the leg's angles, transmission angles and condition number over a turn."""
    figure = Figure(figsize=(8.0, 7.0), layout='constrained')
    panels = figure.subplots(3, 1, sharex=True, height_ratios=(3, 3, 2))
    for axes, what in zip(panels, ('angles', 'transmission', 'condition'), strict=True):
        plot_turn(KlannLeg(), what, ax=axes)
        legend_beside(axes)
        axes.label_outer()
    _, middle, lower = panels
    for line, sum_of in zip(middle.lines, (r'\gamma + \beta', r'\delta + \theta'), strict=True):
        line.set_label(f'{line.get_label()} $= |{sum_of}|$')
    legend_beside(middle)
    lower.set(ylim=(0.0, 16.0))
    return figure


def klann_foot_path() -> Figure:
    """Return the foot path and its stance; dots every 10 deg, velocities every 30 deg."""
    leg = KlannLeg()
    path = foot_path(leg)
    stance = path.stance()
    figure = Figure(figsize=(8.0, 5.4), layout='constrained')
    axes = figure.add_subplot()
    axes.axhspan(path.y_range[0], path.y_range[0] + stance.ground, color=GREEN, alpha=0.15, lw=0)
    plot_foot_path(leg, ax=axes)
    angles = np.linspace(stance.start, stance.end, 200)
    axes.plot(*np.array([leg.solve(a).h for a in angles]).T, color=RED, lw=3.5)
    poses = [leg.solve(math.radians(k)) for k in range(0, 360, 10)]
    feet = np.array([pose.h for pose in poses])
    speeds = np.array([leg.velocity(pose, 1.0).h for pose in poses])
    _dots(axes, feet, size=5)
    arrow = {'angles': 'xy', 'scale_units': 'xy', 'scale': 3.0, 'color': BLUE, 'width': 0.004}
    axes.quiver(*feet[::3].T, *speeds[::3].T, zorder=4, **arrow)
    for k in range(0, 36, 3):
        turned = np.array([speeds[k][1], -speeds[k][0]]) * (-1.0 if path.area > 0.0 else 1.0)
        x, y = feet[k] - 0.022 * turned / math.hypot(*turned)
        axes.annotate(f'{10 * k}{DEG}', (x, y), ha='center', va='center', fontsize=9)
    (x_0, x_1), (y_0, y_1) = path.x_range, path.y_range
    for ends, at in (
        (((x_0, y_0 - 0.05), (x_1, y_0 - 0.05)), (np.mean([x_0, x_1]), y_0 - 0.062)),
        (((x_1 + 0.05, y_0), (x_1 + 0.05, y_1)), (x_1 + 0.06, np.mean([y_0, y_1]))),
    ):
        axes.annotate('', *ends, arrowprops={'arrowstyle': '<->', 'color': GREY})
        size = math.dist(*ends)
        ha, va = ('center', 'top') if at[1] < y_0 else ('left', 'center')
        axes.annotate(f'{1e3 * size:.1f} mm', at, ha=ha, va=va, color=GREY)
    axes.quiver(x_0, y_1, 0.2, 0.0, **arrow)
    axes.annotate(r'$dH/d\alpha$ = 0.2 m/rad', (x_0, y_1 - 0.02), color=BLUE)
    label_plane(axes)
    axes.set(xlim=(x_0 - 0.07, x_1 + 0.15), ylim=(y_0 - 0.1, y_1 + 0.05))
    return figure


def dyad() -> Figure:
    """Return two circles that meet in two joints: the geometric method."""
    p, q, r_p, r_q = (0.0, 0.0), (0.33, 0.09), 0.30, 0.22
    figure = Figure(figsize=(8.0, 5.2), layout='constrained')
    axes = figure.add_subplot()
    for centre, radius, colour in ((p, r_p, BLUE), (q, r_q, GREEN)):
        axes.add_patch(Circle(centre, radius, fill=False, color=colour, lw=1, ls='--'))
    plus, minus = (dyad_joint(p, q, r_p, r_q, sign) for sign in (1, -1))
    foot = np.mean([plus, minus], axis=0)
    for at, alpha in ((plus, 1.0), (minus, 0.35)):
        _bar(axes, p, at, BLUE, alpha=alpha)
        _bar(axes, q, at, GREEN, alpha=alpha)
    axes.plot(*zip(p, q, strict=True), ':', color=GREY)
    axes.plot(*zip(plus, minus, strict=True), ':', color=GREY)
    _dots(axes, [plus, minus])
    _dots(axes, [p, q], 's')
    u = np.array(q) / math.hypot(*q)
    n = np.array([-u[1], u[0]])
    for end, name, side in ((u, '$u$', -n), (n, '$n$', -u)):
        axes.annotate('', 0.09 * end, p, arrowprops={'arrowstyle': '-|>', 'color': RED, 'lw': 2})
        axes.annotate(name, 0.09 * end + 0.02 * side, color=RED, ha='center', va='center', size=13)
    for name, at in (
        ('$P$', -0.025 * u),
        ('$Q$', np.array(q) + 0.028 * u),
        (r'$J_{+}$', np.array(plus) + 0.028 * n),
        (r'$J_{-}$', np.array(minus) - 0.028 * n),
        ('$r_p$', np.array(plus) * 0.6 + 0.03 * n - 0.02 * u),
        ('$r_q$', (np.array(plus) + q) / 2 + 0.02 * (u + n)),
        ('$a$', 0.68 * foot - 0.016 * n),
        ('$h$', (foot + plus) / 2 + 0.016 * u),
    ):
        axes.annotate(name, at, ha='center', va='center', fontsize=14)
    label_plane(axes)
    axes.set(xlim=(-0.33, 0.58), ylim=(-0.32, 0.34))
    return figure


def four_bar() -> Figure:
    """Return the four-bar of the course's examples, put together in both ways."""
    figure = Figure(figsize=(8.0, 4.4), layout='constrained')
    for axes, assembly in zip(figure.subplots(1, 2, sharey=True), (1, -1), strict=True):
        bars = FourBar(*EXAMPLE, assembly)
        pose = bars.solve(math.radians(60.0))
        o_2, a, b, o_4 = pose.points
        axes.plot(*np.array([a, o_4]).T, '--', color=GREY)
        _bar(axes, o_2, o_4, PALE_BLUE)
        plot_pose(pose, ax=axes, letters=False)
        theta = [math.degrees(angle) % 360.0 for angle in (pose.theta2, pose.theta3, pose.theta4)]
        back = math.degrees(math.atan2(a[1] - o_4[1], a[0] - o_4[0]))
        if assembly < 0:
            theta[1] -= 360.0
        draw_angle(axes, o_2, 0.030, (0.0, theta[0]), r'$\theta_2$')
        draw_angle(axes, a, 0.035, (0.0, theta[1]), r'$\theta_3$')
        draw_angle(axes, o_4, 0.030, (0.0, theta[2]), r'$\theta_4$', colour=GREEN)
        draw_angle(axes, o_4, 0.050, (back, 180.0), r'$\beta$')
        draw_angle(axes, o_4, 0.042, (theta[2], back), r'$\alpha$', colour=RED)
        draw_angle(axes, b, 0.030, _sector(b, a, o_4), r'$\mu$', colour=NAVY)
        for name, at, dx, dy in (
            ('$O_2$', o_2, -0.022, 0.009),
            ('$O_4$', o_4, 0.028, -0.012),
            ('$A$', a, -0.012, 0.014),
            ('$B$', b, 0.012, 0.012 * assembly),
            ('$Z$', (a + o_4) / 2, 0.004, 0.012),
        ):
            axes.annotate(name, np.add(at, (dx, dy)), ha='center', va='center', fontsize=13)
        label_plane(axes)
        axes.set(xlim=(-0.045, 0.25), ylim=(-0.15, 0.17))
        sign = '+' if assembly > 0 else '-'
        axes.set_title(rf'$\theta_4 = 180{DEG} - ({sign}\alpha + \beta)$', fontsize=11)
    return figure


def four_bar_dead_points() -> Figure:
    """Return the dead points of a crank (class II) and a rocker (class I), of both assemblies."""
    figure = Figure(figsize=(8.0, 4.2), layout='constrained')
    panels = ((TRIPLE_ROCKER, 'crank', '$L_2$'), (EXAMPLE, 'rocker', '$L_4$'))
    for axes, (lengths, driver, name) in zip(figure.subplots(1, 2), panels, strict=True):
        bars = FourBar(*lengths)
        found = bars.dead_points(driver)
        if driver == 'rocker':
            found += FourBar(*lengths, -1).dead_points(driver)
        for point in found:
            a = bars.geometry.crank * np.array([math.cos(point.theta2), math.sin(point.theta2)])
            o_4 = np.array([bars.geometry.ground, 0.0])
            swing = np.array([math.cos(point.theta4), math.sin(point.theta4)])
            b = o_4 + bars.geometry.rocker * swing
            style = '-' if point.kind == 'stretched' else (0, (2, 1))
            # The links in line lie over each other where they are folded: the wider shows.
            for p, q, colour, width in ((o_4, b, GREEN, 4), ((0, 0), a, RED, 7), (a, b, BLUE, 3)):
                axes.plot(*zip(p, q, strict=True), color=colour, lw=width, ls=style)
            _dots(axes, [a, b])
            end = a if driver == 'crank' else b
            axes.annotate(
                rf'${math.degrees(point.angle):.1f}{DEG}$',
                end,
                xytext=(0, math.copysign(13, end[1])),
                textcoords='offset points',
                ha='center',
                va='center',
                fontsize=9,
            )
        _dots(axes, [(0.0, 0.0), (bars.geometry.ground, 0.0)], 's')
        label_plane(axes)
        axes.set(xlim=(-0.13, 0.29), ylim=(-0.17, 0.17), xticks=(-0.1, 0.0, 0.1, 0.2))
        axes.set_title(name, color=RED if driver == 'crank' else GREEN)
    return figure


def four_bar_transmission() -> Figure:
    """Return the transmission angle of four four-bars over the crank's turn."""
    figure = Figure(figsize=(8.0, 4.2), layout='constrained')
    axes = figure.add_subplot()
    axes.axhspan(40.0, 140.0, color=GREEN, alpha=0.15, linewidth=0)
    shown = (EXAMPLE, EXERCISE, DISCS, TRIPLE_ROCKER)
    for lengths, colour in zip(shown, (RED, BLUE, YELLOW, NAVY), strict=True):
        bars = FourBar(*lengths)
        name = ', '.join(f'{1e3 * length:g}' for length in lengths) + ' mm'
        # Each has one arc: a whole turn, or one around 0.
        ((start, end),) = bars.reachable_arcs()
        angles = np.linspace(start - end, end - start, 721) / 2.0
        mu = np.degrees([bars.transmission_angle(angle) for angle in angles])
        axes.plot(np.degrees(angles), mu, color=colour, label=name)
    axes.set(xlabel=rf'$\theta_2$ / {DEG}', ylabel=rf'$\mu$ / {DEG}')
    axes.set(xlim=(-180, 180), ylim=(0, 180), yticks=(0, 40, 90, 140, 180))
    axes.set_xticks(range(-180, 181, 60))
    grid(axes)
    axes.legend(title='$L_1, L_2, L_3, L_4$', frameon=False, fontsize='small')
    return figure


def two_discs() -> Figure:
    """Return the two discs' angles over a turn by both methods, and their difference."""
    bars, alphas = FourBar(*DISCS), np.arange(0.0, 361.0)
    newton = np.unwrap([bars.solve(math.radians(a)).x for a in alphas], axis=0)
    geometric = np.unwrap([bars.closed_form(math.radians(a)).x for a in alphas], axis=0)
    figure = Figure(figsize=(8.0, 5.4), layout='constrained')
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    plot_turn(bars, ax=upper)
    dots = slice(None, None, 15)
    for k, (line, name) in enumerate(zip(upper.get_lines(), ('BC', 'DC'), strict=True)):
        colour = line.get_color()
        line.set_label(name)
        upper.plot(alphas[dots], np.degrees(newton[dots, k]), 'o', color=colour, mfc='none')
        lower.plot(alphas, 1e15 * (newton - geometric)[:, k], '.', ms=3, color=colour, label=name)
    upper.set(xlabel='', ylabel=f'BC, DC / {DEG}')
    lower.set(xlabel=f'AB / {DEG}', ylabel=r'$\Delta$ / $10^{-15}$ rad')
    grid(lower)
    for axes in (upper, lower):
        legend_beside(axes)
    return figure


def linkages() -> Figure:
    """Return four of the linkages that are described in files, with the paths of their feet."""
    figure = Figure(figsize=(8.0, 7.2), layout='constrained')
    panels = (
        ('klann', 60, 'Klann'),
        ('jansen', 0, 'Jansen'),
        ('chebyshev_lambda', 30, r'Chebyshev $\lambda$'),
        ('stephenson', 90, 'Stephenson III'),
    )
    for axes, (name, alpha, title) in zip(figure.subplots(2, 2).flat, panels, strict=True):
        linkage = shipped_linkage(name)
        plot_foot_path(linkage, ax=axes, color=GREY)
        plot_pose(linkage, math.radians(alpha), ax=axes, width=2.5)
        axes.set_title(title, fontsize=10)
        axes.locator_params(axis='x', nbins=5)
    return figure


def plots() -> Figure:
    """Return the plots that any linkage has, here Jansen's leg."""
    leg = LinkageLeg(shipped_linkage('jansen'))
    figure = Figure(figsize=(7.2, 6.0), layout='constrained')
    plane, angles, transmission, convergence = figure.subplots(2, 2).flat
    plot_foot_path(leg, ax=plane)
    plot_pose(leg, math.radians(120.0), ax=plane, width=2.5)
    plot_turn(leg, ax=angles)
    plot_turn(leg, 'transmission', ax=transmission)
    guess = np.radians([140.0, 70.0, 210.0, 250.0, 280.0, 170.0])
    plot_convergence(leg, 0.0, guess, ax=convergence)
    for axes in (angles, transmission, convergence):
        axes.legend(frameon=False, fontsize='small', ncols=2)
    return figure


def data_flow() -> Figure:
    """Return what hears whom: nodes, the topics between them, the run and what opens it."""
    figure = Figure(figsize=(9.6, 3.5), layout='constrained')
    axes = figure.add_subplot(aspect='equal', xlim=(-0.1, 15.1), ylim=(-0.1, 5.4))
    axes.axis('off')
    boxes = {
        'crank_node': (1.3, 4.2, BLUE),
        'robot': (1.3, 2.7, GREY),
        'solver_node': (6.0, 3.45, BLUE),
        'RViz, Foxglove': (10.3, 4.7, GREY),
        'recorder_node': (10.3, 2.6, BLUE),
        'run (MCAP)': (13.7, 2.6, YELLOW),
        'player_node': (6.0, 0.5, BLUE),
        'review': (10.3, 0.5, GREEN),
        'recover': (13.7, 0.5, GREEN),
    }
    width, height = 2.3, 0.64
    for name, (x, y, colour) in boxes.items():
        corner = (x - width / 2.0, y - height / 2.0)
        look = {'facecolor': colour, 'edgecolor': colour, 'alpha': 0.2}
        axes.add_patch(FancyBboxPatch(corner, width, height, 'round,pad=0.08', **look))
        axes.text(x, y, name, ha='center', va='center', size=10, weight='bold')
    right, down = np.array([width / 2.0 + 0.13, 0.0]), np.array([0.0, -height / 2.0 - 0.13])
    poses = 'joint_states\npoint_h\nvelocity_h'
    for start, end, side, topics, (dx, dy) in (
        ('crank_node', 'solver_node', right, 'crank_angle', (0.1, 0.32)),
        ('robot', 'solver_node', right, 'crank_state', (0.1, -0.3)),
        ('solver_node', 'RViz, Foxglove', right, 'markers', (-0.5, 0.3)),
        ('solver_node', 'recorder_node', right, poses, (-0.35, -0.75)),
        ('recorder_node', 'run (MCAP)', right, '', (0.0, 0.0)),
        ('run (MCAP)', 'player_node', down, '', (0.0, 0.0)),
        ('run (MCAP)', 'review', down, '', (0.0, 0.0)),
        ('run (MCAP)', 'recover', down, '', (0.0, 0.0)),
    ):
        p, q = boxes[start][:2] + side, boxes[end][:2] - side
        axes.add_patch(FancyArrowPatch(p, q, arrowstyle='-|>', mutation_scale=14, color='black'))
        x, y = (p + q) / 2.0
        axes.text(x + dx, y + dy, topics, ha='center', va='center', size=9, family='monospace')
    return figure


FIGURES: tuple[Callable[[], Figure], ...] = (
    klann_leg,
    newton_convergence,
    klann_turn,
    klann_foot_path,
    dyad,
    four_bar,
    four_bar_dead_points,
    four_bar_transmission,
    two_discs,
    linkages,
    plots,
    data_flow,
)


def main(folder: Path) -> None:
    """Make every figure, each under the name of its function."""
    for make in FIGURES:
        make().savefig(folder / f'{make.__name__}.png', dpi=110)


def _bar(
    axes: Axes, p: Point, q: Point, colour: str, *, alpha: float = 1.0, width: float = 4.0
) -> None:
    axes.plot(*zip(p, q, strict=True), color=colour, lw=width, alpha=alpha, solid_capstyle='round')


def _dots(axes: Axes, points: Iterable[Point], marker: str = 'o', size: float = 7) -> None:
    axes.plot(*np.array(points).T, marker, color='white', mec='black', ms=size, ls='', zorder=3)


def _sector(at: Point, p: Point, q: Point) -> tuple[float, float]:
    """Return the directions from a point to two others, less than half a turn apart [deg]."""
    first, last = (math.degrees(math.atan2(e[1] - at[1], e[0] - at[0])) for e in (p, q))
    return first, first + math.degrees(math.remainder(math.radians(last - first), math.tau))


if __name__ == '__main__':
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else FOLDER)
