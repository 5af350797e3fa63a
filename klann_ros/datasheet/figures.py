"""The figures of a data sheet, as text and page show them: name, value, unit and remark."""

from collections.abc import Iterator, Sequence
from math import degrees, floor, inf, isfinite, log10, pi
from typing import NamedTuple

from klann_ros.dynamics import Masses, TurnOfForces
from klann_ros.kinematics.angles import TURN
from klann_ros.sanitize.text import counted, decimal, printable

from .sheet import cases, CrankSheet, DataSheet, Extreme, LegSheet

# Speed fluctuation of a crank for which a flywheel is sized.
SPEED_FLUCTUATION = 0.1
# Sampling error of a mean over a turn, as a part of the peak.
SAMPLING_ERROR = 1e-5
# Transmission angle limit, from in line [rad] (Norton, Design of Machinery).
GOOD_TRANSMISSION = 40.0 * pi / 180.0
# Rows of the table of support patterns.
MAX_PATTERNS = 12
UNKNOWN_VALUE = '\N{EN DASH}'


class Figure(NamedTuple):
    """A figure: its name, its value as text, its unit, and a note."""

    name: str
    value: str
    unit: str = ''
    note: str = ''


class FigureTable(NamedTuple):
    """A table: its title, the heads of its columns, its rows and a note."""

    title: str
    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ''


def number_text(quantity: float, digits: int = 4) -> str:
    """Return a number with significant digits, without an exponent if that is short."""
    if not isfinite(quantity):
        return UNKNOWN_VALUE
    if quantity == 0.0:
        return '0'
    power = floor(log10(abs(quantity)))
    if -4 <= power < 6:
        return f'{quantity:.{max(digits - 1 - power, 0)}f}'
    return f'{quantity:.{digits - 1}e}'


def degrees_text(radians: float, digits: int = 1) -> str:
    """Return an angle in degrees."""
    return decimal(degrees(radians), f'.{digits}f') if isfinite(radians) else UNKNOWN_VALUE


def mm_text(metres: float) -> str:
    """Return a length in millimetres."""
    return number_text(1e3 * metres, 4)


def summary(sheet: DataSheet) -> str:
    """Return the cranks' rate and the load on the feet in a line."""
    direction = 'clockwise' if sheet.speed < 0.0 else 'counter-clockwise'
    speed = abs(sheet.speed)
    turns = f'{number_text(speed)} rad/s ({number_text(speed * 30.0 / pi)} rpm), {direction}'
    load = f', {number_text(sheet.load)} N on each foot in stance' if sheet.load else ''
    return f'cranks at {turns}{load}'


def turning_text(leg: LegSheet) -> str:
    """Return whether a crank turns fully, or else the arcs that it reaches."""
    if leg.turns_fully:
        return 'the crank turns fully'
    arcs = ', '.join(
        _span(degrees_text(start, 3), degrees_text(end, 3)) for start, end in leg.arcs
    )
    return f'the crank does not turn fully; it reaches {arcs or "nothing"} deg'


def change_point_table(leg: LegSheet) -> FigureTable:
    """Return the table of the change points of a leg, with both motions that meet there."""
    points = leg.linkage.change_points
    lines = []
    for point in sorted(points.points, key=lambda point: point.beta % (points.period * TURN)):
        motions = []
        for motion in points.continuations(point):
            rates = UNKNOWN_VALUE
            if motion is not None:
                rates = ', '.join(number_text(round(rate, 9), 3) for rate in motion.tolist())
            motions.append(rates)
        derivative = 'first' if point.order == 1 else 'second'
        kind = 'ends coincide, links may spin freely' if point.is_free else 'in line'
        angle = degrees_text(point.beta % (points.period * TURN), 3)
        links = ', '.join(points.links(point))
        lines.append((angle, links, kind, derivative, *motions))
    period = f'; all links are back after {points.period} turns' if points.period > 1 else ''
    note = (
        'Derivatives of the angles by the crank angle; links that move take the path; '
        f'a crank at rest there leaves the motion to inertia and play{period}.'
    )
    heads = ('Crank [deg]', 'Links', 'Change point', 'Derivative', 'Path', 'Other motion')
    return FigureTable('Change points', heads, tuple(lines), note)


def near_miss_texts(leg: LegSheet) -> Iterator[str]:
    """Yield the change points that are missed by a hair."""
    points = leg.linkage.change_points
    for miss in points.near_misses:
        links = ', '.join(points.links(miss))
        yield (
            f'at {degrees_text(miss.beta % TURN, 3)} deg the links {links} are in line but for '
            f'{number_text(1e3 * miss.clearance, 3)} mm: play decides which way they go on'
        )


def point_title(leg: LegSheet) -> str:
    """Return the name of the published point: as a foot, a point of a coupler, or neither."""
    structure = leg.linkage.structure
    kind = 'point' if all(structure.foot_guides) else 'coupler point'
    return f'{"foot" if leg.has_foot else kind} {structure.foot}'


def foot_figures(leg: LegSheet, speed: float) -> Iterator[Figure]:
    """Yield the figures of a foot while the crank turns at a speed [rad/s]."""
    path = leg.path
    stance = leg.shown_stance
    if path is not None:
        # Rounding counts as 0.
        stride = _zero(path.stride, path.length)
        lift = _zero(path.lift, path.length)
        width = 'Stride' if leg.has_foot else 'Width of the path'
        height = 'Lift' if leg.has_foot else 'Height of the path'
        yield Figure(width, mm_text(stride), 'mm', _range('x', *path.x_range))
        yield Figure(height, mm_text(lift), 'mm', _range('y', *path.y_range))
        yield Figure('Path', mm_text(path.length), 'mm', 'its length')
    if stance is None:
        return
    end_text = degrees_text(stance.end % stance.period)
    turns = round(stance.period / TURN)
    period = 'the turn' if turns == 1 else f'{turns} turns'
    angles = f'crank {_span(degrees_text(stance.start), end_text)} deg'
    yield Figure('Stance', f'{100.0 * stance.duty_factor:.1f}', '%', f'of {period}, {angles}')
    band = mm_text(_zero(stance.ground, stance.ground_covered))
    ground = f'within {band} mm above the lowest point'
    yield Figure('Ground covered', mm_text(stance.ground_covered), 'mm', ground)
    deviation = _zero(stance.deviation, stance.ground_covered)
    minimax = mm_text(_zero(stance.minimax_deviation, stance.ground_covered))
    share = f'{100.0 * stance.straightness:.2f} % of the ground covered'
    straightness = f'least squares, {share}; {minimax} mm from the best line'
    yield Figure('Off straight', mm_text(deviation), 'mm', straightness)
    rate = abs(speed)
    ripple = f'; ripple {100.0 * stance.ripple:.0f} %' if isfinite(stance.ripple) else ''
    min_speed = _zero(stance.speed_least, stance.speed_mean)
    span = _span(number_text(rate * min_speed, 3), number_text(rate * stance.speed_greatest, 3))
    yield Figure('Foot speed', number_text(rate * stance.speed_mean), 'm/s', f'{span}{ripple}')


def _range(axis: str, low: float, high: float) -> str:
    return f'{axis} {_span(mm_text(low), mm_text(high))} mm'


def _span(low: str, high: str) -> str:
    return f'{low} .. {high}'


def bar_table(leg: LegSheet) -> FigureTable:
    """Return the table of a leg's dimensions."""
    has_margins = not leg.no_margins
    heads = ('Number', 'Value', 'Unit', *(('Turns fully from', 'to') if has_margins else ()))
    lines = []
    for bar in leg.bars:
        show = mm_text if bar.unit == 'm' else degrees_text
        limits: tuple[str, ...] = ()
        if has_margins and bar.margin is None:
            limits = (UNKNOWN_VALUE, UNKNOWN_VALUE)
        elif has_margins and bar.margin is not None:
            margin = bar.margin
            limits = (
                show(margin.least) if isfinite(margin.least) else 'any',
                show(margin.greatest) if isfinite(margin.greatest) else 'any',
            )
        lines.append((bar.name, show(bar.value), 'mm' if bar.unit == 'm' else 'deg', *limits))
    note = (
        'One number changed at a time, all others unchanged.'
        if has_margins
        else f'No margins: {leg.no_margins}.'
    )
    return FigureTable('Bars', heads, tuple(lines), note)


def transmission_table(leg: LegSheet) -> FigureTable:
    """Return the table of a leg's transmission angles."""
    lines = []
    warning = ''
    for dyad in leg.transmission:
        angles = (*dyad.least, *dyad.greatest, dyad.from_in_line.value)
        lines.append((dyad.name, *map(degrees_text, angles)))
        if dyad.from_in_line.value < GOOD_TRANSMISSION:
            warning = '; here it is less'
    heads = ('Links', 'Least / deg', 'at crank', 'Greatest / deg', 'at crank', 'From in line')
    note = (
        f'Good practice is {degrees_text(GOOD_TRANSMISSION, 0)} deg from in line or more{warning}.'
    )
    return FigureTable('Transmission angles', heads, tuple(lines), note)


def mass_table(leg: LegSheet, masses: Masses) -> FigureTable:
    """Return the table of a leg's masses."""
    lines = []
    size = max(abs(centre) for _, centre, _ in masses.bodies)
    for label, (mass, centre, inertia) in zip(
        leg.linkage.structure.labels, masses.bodies, strict=True
    ):
        place = mm_text(_zero(centre.real, size)), mm_text(_zero(centre.imag, size))
        lines.append((label, number_text(mass), *place, number_text(inertia)))
    heads = ('Body', 'Mass / kg', 'Centre x / mm', 'y / mm', 'Inertia / kg m²')
    total = (
        f'{number_text(masses.total)} kg {"a leg" if leg.has_foot else "in all"}, {masses.origin}'
    )
    note = f'{total}. The centre is from the first point of the body.'
    return FigureTable('Masses', heads, tuple(lines), note)


def joint_force_table(leg: LegSheet) -> FigureTable:
    """Return the table of the largest force of each joint of a leg."""
    heads = ['Joint']
    joints_of_cases = []
    for name, forces in cases(leg):
        heads += [f'{name} / N', 'at crank / deg']
        joints_of_cases.append(forces.joints)
    lines = []
    for joint_cases in zip(*joints_of_cases, strict=True):
        name = joint_cases[0].name
        lines.append((name, *_peaks([joint.greatest for joint in joint_cases])))
        moments = [joint.moment for joint in joint_cases if joint.moment is not None]
        if moments:
            lines.append((f'{name}: moment / N m', *_peaks(moments)))
    peaks = [joint.greatest.value for joints in joints_of_cases for joint in joints]
    note = 'The largest of a turn.'
    if inf in peaks:
        note += f' {UNKNOWN_VALUE}: it grows without bound towards a change point.'
    return FigureTable('Joint reactions', tuple(heads), tuple(lines), note)


def _peaks(extremes: Sequence[Extreme]) -> list[str]:
    cells = []
    for extreme in extremes:
        cells += [number_text(extreme.value), degrees_text(extreme.at)]
    return cells


def crank_force_table(crank: CrankSheet, speed: float) -> FigureTable:
    """Return the table of a crank's torque and power, without and with the load."""
    named_turns = cases(crank)
    columns = [_crank_column(turn, speed) for _, turn in named_turns]
    lines = []
    for figures in zip(*columns, strict=True):
        cells = [figure.value for figure in figures]
        lines.append((figures[0].name, *cells, figures[0].unit))
    heads = ('Over the turn', *(name for name, _ in named_turns), 'unit')
    note = (
        'Energy swing: stored and returned by a shaft with the mean torque. '
        f'Flywheel: for a speed within +-{100.0 * SPEED_FLUCTUATION / 2.0:.0f} %.'
    )
    return FigureTable('Crank', heads, tuple(lines), note)


def crank_title(crank: CrankSheet) -> str:
    """Return the title of a crank among others."""
    return 'Crank' if crank.joint == 'crank' else f'Crank {crank.joint}'


def _crank_column(turn: TurnOfForces, speed: float) -> list[Figure]:
    power = turn.power
    mean_power = _zero(turn.mean * turn.rate, turn.peak * abs(speed))
    return [
        Figure('Torque, least', number_text(float(turn.torque.min())), 'N m'),
        Figure('Torque, greatest', number_text(float(turn.torque.max())), 'N m'),
        Figure('Torque, rms', number_text(turn.rms), 'N m'),
        Figure('Torque, mean', number_text(_zero(turn.mean, turn.peak)), 'N m'),
        Figure('Power, least', number_text(float(power.min())), 'W'),
        Figure('Power, greatest', number_text(float(power.max())), 'W'),
        Figure('Power, mean', number_text(mean_power), 'W'),
        Figure('Energy swing', number_text(turn.energy_swing), 'J'),
        Figure('Flywheel', number_text(turn.flywheel(SPEED_FLUCTUATION)), 'kg m²'),
    ]


def _zero(quantity: float, scale: float) -> float:
    """Return a quantity; 0 within the sampling error of a mean."""
    return 0.0 if abs(quantity) <= SAMPLING_ERROR * scale else quantity


def motor_figures(crank: CrankSheet) -> Iterator[Figure]:
    """Yield the figures of a motor and of its crank's requirements."""
    verdict = crank.motor
    if verdict is None:
        return
    motor = verdict.motor
    yield Figure('Stall torque', number_text(motor.output_stall_torque), 'N m', 'at the gear')
    yield Figure('Available torque', number_text(verdict.available), 'N m', 'at this speed')
    peak_angle = f'at {degrees_text(verdict.peak_at)} deg' if verdict.peak else ''
    yield Figure('Required torque', number_text(verdict.peak), 'N m', peak_angle)
    yield Figure('Margin', _times(verdict.margin), '', '1 is just enough')
    braking = f'{number_text(verdict.braking_peak)} of {number_text(motor.holding_torque)} N m'
    yield Figure('Braking margin', _times(verdict.braking_margin), '', braking)
    thermal = verdict.thermal_margin
    rms = f'{number_text(verdict.motor_rms)} N m rms at the motor'
    if thermal is None:
        yield Figure('Thermal margin', UNKNOWN_VALUE, '', f'{rms}; no continuous_torque is given')
    else:
        yield Figure('Thermal margin', _times(thermal), '', rms)
    rpm = f'{number_text(verdict.fastest * 30.0 / pi)} rpm, by torque and speed'
    note = rpm if verdict.fastest else 'it cannot start from standstill'
    yield Figure('Fastest', number_text(verdict.fastest), 'rad/s', note)


def _times(margin: float) -> str:
    if margin == inf:
        return 'any'
    return f'{margin:.2f}' if margin < 100.0 else number_text(margin)


def motor_line(sheet: DataSheet) -> str:
    """Return the verdict on the motor in a line; '' without a motor."""
    if sheet.motor is None:
        return ''
    speed = f'{number_text(abs(sheet.speed))} rad/s'
    if sheet.motor_turns:
        return f'the motor can turn it at {speed}, {motor_reason(sheet)}'
    return f'the motor cannot turn it at {speed}: {motor_reason(sheet)}'


def motor_reason(sheet: DataSheet) -> str:
    """Return the margin of a motor that can turn every crank, or else the faults of the cranks."""
    if sheet.motor_turns:
        margins = [crank.motor.margin for crank in sheet.cranks if crank.motor]
        return f'margin {_times(min(margins))}'
    reasons = []
    for crank in sheet.cranks:
        faults = crank.motor.faults if crank.motor else ('the crank does not turn fully',)
        joint = f'{printable(crank.joint)}: ' if len(sheet.cranks) > 1 else ''
        if faults:
            reasons.append(f'{joint}{", and ".join(faults)}')
    return '; '.join(reasons)


def walk_figures(sheet: DataSheet) -> Iterator[Figure]:
    """Yield the figures of a walker over a turn of its cranks, on level ground."""
    walk = sheet.walk
    if walk is None:
        return
    yield Figure(
        'Speed', number_text(abs(walk.speed * sheet.speed)), 'm/s', 'straight on, cranks alike'
    )
    yield Figure('Stride', mm_text(walk.stride), 'mm', 'a turn of the cranks')
    note = 'of the centre of mass in the support polygon; negative is outside'
    yield Figure('Least static margin', mm_text(walk.least_margin), 'mm', note)
    yield Figure('Statically stable', f'{100.0 * walk.stable_fraction:.1f}', '%', 'of the turn')
    if walk.stable_fraction:
        yield Figure('Height variation', mm_text(walk.height_variation), 'mm', 'of the body')
        yield Figure('Pitch', degrees_text(walk.greatest_pitch, 2), 'deg', 'at most')
        yield Figure('Roll', degrees_text(walk.greatest_roll, 2), 'deg', 'at most')
    costs = sheet.costs_of_transport
    if costs is None:
        yield Figure('Cost of transport', '-', '', 'P/(m g v); it needs masses and --load')
    else:
        note = (
            f'P/(m g v) by positive power; by absolute power {number_text(costs.absolute_power)}'
        )
        yield Figure('Cost of transport', number_text(costs.positive_power), '', note)
    yield Figure('Foot slip', mm_text(walk.slid), 'mm', 'a turn, weighted by load')


def support_table(sheet: DataSheet) -> FigureTable | None:
    """Return the table of a walker's support patterns."""
    if sheet.walk is None:
        return None
    shares = sheet.walk.support_patterns()
    lines = []
    for feet, share in list(shares.items())[:MAX_PATTERNS]:
        lines.append((f'{100.0 * share:.1f}', str(len(feet)), ', '.join(feet) or 'unstable'))
    hidden_count = len(shares) - len(lines)
    note = f'{counted(hidden_count, "more pattern")}.' if hidden_count else ''
    return FigureTable('Supports', ('Part of the turn / %', 'Feet', 'Legs'), tuple(lines), note)
