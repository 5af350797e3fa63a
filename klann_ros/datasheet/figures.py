"""The figures of a data sheet, as text and page show them: name, value, unit and remark."""

from collections.abc import Iterator, Sequence
from math import degrees, floor, inf, isfinite, log10, pi
from typing import NamedTuple

from klann_ros.dynamics import TurnOfForces
from klann_ros.kinematics.angles import TURN
from klann_ros.sanitize.text import counted, printable

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


def number(value: float, digits: int = 4) -> str:
    """Return a number with significant digits, without an exponent if that is short."""
    if not isfinite(value):
        return UNKNOWN_VALUE
    if value == 0.0:
        return '0'
    power = floor(log10(abs(value)))
    if -4 <= power < 6:
        return f'{value:.{max(digits - 1 - power, 0)}f}'
    return f'{value:.{digits - 1}e}'


def degree(radians: float, digits: int = 1) -> str:
    """Return an angle in degrees."""
    return f'{degrees(radians):.{digits}f}' if isfinite(radians) else UNKNOWN_VALUE


def millimetres(metres: float) -> str:
    """Return a length in millimetres."""
    return number(1e3 * metres, 4)


def about(sheet: DataSheet) -> str:
    """Return the cranks' rate and the load on the feet in a line."""
    direction = 'clockwise' if sheet.speed < 0.0 else 'counter-clockwise'
    speed = abs(sheet.speed)
    turns = f'{number(speed)} rad/s ({number(speed * 30.0 / pi)} rpm), {direction}'
    load = f', {number(sheet.load)} N on each foot in stance' if sheet.load else ''
    return f'cranks at {turns}{load}'


def turning(leg: LegSheet) -> str:
    """Return whether a crank turns fully, or else the arcs that it reaches."""
    if leg.turns_fully:
        return 'the crank turns fully'
    arcs = ', '.join(_span(degree(start, 3), degree(end, 3)) for start, end in leg.arcs)
    return f'the crank does not turn fully; it reaches {arcs or "nothing"} deg'


def foot_figures(leg: LegSheet, speed: float) -> Iterator[Figure]:
    """Yield the figures of a foot while the crank turns at a speed [rad/s]."""
    path, stance = leg.path, leg.stance
    if path is not None:
        left, right = path.x_range
        low, high = path.y_range
        # Rounding counts as 0.
        stride, lift = _zero(path.stride, path.length), _zero(path.lift, path.length)
        yield Figure('Stride', millimetres(stride), 'mm', _range('x', left, right))
        yield Figure('Lift', millimetres(lift), 'mm', _range('y', low, high))
        yield Figure('Path', millimetres(path.length), 'mm', 'its length')
    if stance is None:
        return
    at = f'crank {_span(degree(stance.start), degree(stance.end % TURN))} deg'
    yield Figure('Stance', f'{100.0 * stance.duty_factor:.1f}', '%', f'of the turn, {at}')
    band = millimetres(_zero(stance.ground, stance.ground_covered))
    ground = f'within {band} mm above the lowest point'
    yield Figure('Ground covered', millimetres(stance.ground_covered), 'mm', ground)
    off = f'{100.0 * stance.straightness:.2f} % of the ground covered'
    deviation = _zero(stance.deviation, stance.ground_covered)
    yield Figure('Off straight', millimetres(deviation), 'mm', off)
    rate = abs(speed)
    ripple = f'; ripple {100.0 * stance.ripple:.0f} %' if isfinite(stance.ripple) else ''
    least = _zero(stance.speed_least, stance.speed_mean)
    span = _span(number(rate * least, 3), number(rate * stance.speed_greatest, 3))
    yield Figure('Foot speed', number(rate * stance.speed_mean), 'm/s', f'{span}{ripple}')


def _range(axis: str, low: float, high: float) -> str:
    return f'{axis} {_span(millimetres(low), millimetres(high))} mm'


def _span(low: str, high: str) -> str:
    return f'{low} .. {high}'


def bars(leg: LegSheet) -> FigureTable:
    """Return the table of a leg's dimensions."""
    has_margins = not leg.no_margins
    heads = ('Number', 'Value', 'Unit', *(('Turns fully from', 'to') if has_margins else ()))
    rows = []
    for bar in leg.bars:
        show = millimetres if bar.unit == 'm' else degree
        ends: tuple[str, ...] = ()
        if has_margins:
            known = bar.margin is not None
            limits = (bar.margin.least, bar.margin.greatest) if bar.margin else (inf, inf)
            ends = tuple('any' if known and not isfinite(x) else show(x) for x in limits)
        rows.append((bar.name, show(bar.value), 'mm' if bar.unit == 'm' else 'deg', *ends))
    note = (
        'One number changed at a time, all others unchanged.'
        if has_margins
        else f'No margins: {leg.no_margins}.'
    )
    return FigureTable('Bars', heads, tuple(rows), note)


def transmission(leg: LegSheet) -> FigureTable:
    """Return the table of a leg's transmission angles."""
    rows = tuple(
        (each.name, *map(degree, (*each.least, *each.greatest, each.from_in_line.value)))
        for each in leg.transmission
    )
    heads = ('Links', 'Least / deg', 'at crank', 'Greatest / deg', 'at crank', 'From in line')
    poor = [each for each in leg.transmission if each.from_in_line.value < GOOD_TRANSMISSION]
    less = '; here it is less' if poor else ''
    note = f'Good practice is {degree(GOOD_TRANSMISSION, 0)} deg from in line or more{less}.'
    return FigureTable('Transmission angles', heads, rows, note)


def masses(leg: LegSheet) -> FigureTable:
    """Return the table of a leg's masses."""
    rows = tuple(
        (name, number(mass), *map(millimetres, centre), number(inertia))
        for name, mass, centre, inertia in leg.masses
    )
    heads = ('Body', 'Mass / kg', 'Centre x / mm', 'y / mm', 'Inertia / kg m²')
    note = f'{number(leg.mass)} kg a leg. The centre is from the first point of the body.'
    return FigureTable('Masses', heads, rows, note)


def joint_forces(leg: LegSheet) -> FigureTable:
    """Return the table of the largest force of each joint of a leg."""
    columns = cases(leg)
    heads = ['Joint']
    for name, _ in columns:
        heads += [f'{name} / N', 'at crank / deg']
    rows = []
    for same in zip(*(of.joints for _, of in columns), strict=True):
        rows.append((same[0].name, *_peaks([joint.greatest for joint in same])))
        moments = [joint.moment for joint in same if joint.moment is not None]
        if moments:
            rows.append((f'{same[0].name}: moment / N m', *_peaks(moments)))
    return FigureTable('Joint reactions', tuple(heads), tuple(rows), 'The largest of a turn.')


def _peaks(extremes: Sequence[Extreme]) -> list[str]:
    return [text for value, at in extremes for text in (number(value), degree(at))]


def crank_forces(crank: CrankSheet, speed: float) -> FigureTable:
    """Return the table of a crank's torque and power, without and with the load."""
    columns = cases(crank)
    cells = [_crank_column(turn, speed) for _, turn in columns]
    rows = [
        (same[0].name, *(figure.value for figure in same), same[0].unit)
        for same in zip(*cells, strict=True)
    ]
    heads = ('Over the turn', *(name for name, _ in columns), 'unit')
    note = (
        'Energy swing: stored and returned by a shaft with the mean torque. '
        f'Flywheel: for a speed within +-{100.0 * SPEED_FLUCTUATION / 2.0:.0f} %.'
    )
    return FigureTable('Crank', heads, tuple(rows), note)


def crank_title(crank: CrankSheet) -> str:
    """Return the title of a crank among others."""
    return 'Crank' if crank.joint == 'crank' else f'Crank {crank.joint}'


def _crank_column(turn: TurnOfForces, speed: float) -> list[Figure]:
    power = turn.power
    return [
        Figure('Torque, least', number(float(turn.torque.min())), 'N m'),
        Figure('Torque, greatest', number(float(turn.torque.max())), 'N m'),
        Figure('Torque, rms', number(turn.rms), 'N m'),
        Figure('Torque, mean', number(_zero(turn.mean, turn.peak)), 'N m'),
        Figure('Power, least', number(float(power.min())), 'W'),
        Figure('Power, greatest', number(float(power.max())), 'W'),
        Figure('Power, mean', number(_zero(turn.mean * turn.rate, turn.peak * abs(speed))), 'W'),
        Figure('Energy swing', number(turn.energy_swing), 'J'),
        Figure('Flywheel', number(turn.flywheel(SPEED_FLUCTUATION)), 'kg m²'),
    ]


def _zero(value: float, scale: float) -> float:
    """Return a value; 0 within the sampling error of a mean."""
    return 0.0 if abs(value) <= SAMPLING_ERROR * scale else value


def motor_figures(crank: CrankSheet) -> Iterator[Figure]:
    """Yield the figures of a motor and of its crank's requirements."""
    judged = crank.motor
    if judged is None:
        return
    motor = judged.motor
    yield Figure('Stall torque', number(motor.output_stall_torque), 'N m', 'at the gear')
    yield Figure('Available torque', number(judged.available), 'N m', 'at this speed')
    at = f'at {degree(judged.peak_at)} deg'
    yield Figure('Required torque', number(judged.peak), 'N m', at if judged.peak else '')
    yield Figure('Margin', _times(judged.margin), '', '1 is just enough')
    held = f'{number(judged.braking_peak)} of {number(motor.holding_torque)} N m'
    yield Figure('Braking margin', _times(judged.braking_margin), '', held)
    thermal = judged.thermal_margin
    rms = f'{number(judged.motor_rms)} N m rms at the motor'
    if thermal is None:
        yield Figure('Thermal margin', UNKNOWN_VALUE, '', f'{rms}; no continuous_torque is given')
    else:
        yield Figure('Thermal margin', _times(thermal), '', rms)
    rpm = f'{number(judged.fastest * 30.0 / pi)} rpm, by torque and speed'
    note = rpm if judged.fastest else 'it cannot start from standstill'
    yield Figure('Fastest', number(judged.fastest), 'rad/s', note)


def _times(margin: float) -> str:
    if margin == inf:
        return 'any'
    return f'{margin:.2f}' if margin < 100.0 else number(margin)


def motor_line(sheet: DataSheet) -> str:
    """Return the verdict on the motor in a line; '' without a motor."""
    if sheet.motor is None:
        return ''
    speed = f'{number(abs(sheet.speed))} rad/s'
    if sheet.motor_turns:
        margins = [crank.motor.margin for crank in sheet.cranks if crank.motor]
        return f'the motor can turn it at {speed}, margin {_times(min(margins))}'
    why = []
    for crank in sheet.cranks:
        faults = crank.motor.faults if crank.motor else ('the crank does not turn fully',)
        of = f'{printable(crank.joint)}: ' if faults and len(sheet.cranks) > 1 else ''
        why += [f'{of}{", and ".join(faults)}'] if faults else []
    return f'the motor cannot turn it at {speed}: {"; ".join(why)}'


def walk_figures(sheet: DataSheet) -> Iterator[Figure]:
    """Yield the figures of a walker over a turn of its cranks, on level ground."""
    walk = sheet.walk
    if walk is None:
        return
    yield Figure(
        'Speed', number(abs(walk.speed * sheet.speed)), 'm/s', 'straight on, cranks alike'
    )
    yield Figure('Stride', millimetres(walk.stride), 'mm', 'a turn of the cranks')
    note = 'of the centre of mass in the support polygon; negative is outside'
    yield Figure('Least static margin', millimetres(walk.least_margin), 'mm', note)
    yield Figure('Statically stable', f'{100.0 * walk.stable_fraction:.1f}', '%', 'of the turn')
    if walk.stable_fraction:
        yield Figure('Height variation', millimetres(walk.height_variation), 'mm', 'of the body')
        yield Figure('Pitch', degree(walk.greatest_pitch, 2), 'deg', 'at most')
        yield Figure('Roll', degree(walk.greatest_roll, 2), 'deg', 'at most')
    yield Figure('Foot slip', millimetres(walk.slid), 'mm', 'a turn, weighted by load')


def supports(sheet: DataSheet) -> FigureTable | None:
    """Return the table of a walker's support patterns."""
    if sheet.walk is None:
        return None
    shares = sheet.walk.support_patterns()
    rows = [
        (f'{100.0 * share:.1f}', str(len(feet)), ', '.join(feet) or 'unstable')
        for feet, share in list(shares.items())[:MAX_PATTERNS]
    ]
    more = len(shares) - len(rows)
    note = f'{counted(more, "more pattern")}.' if more else ''
    return FigureTable('Supports', ('Part of the turn / %', 'Feet', 'Legs'), tuple(rows), note)
