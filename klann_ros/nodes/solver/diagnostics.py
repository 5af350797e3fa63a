"""The solver's figures as a diagnostic status."""

from collections.abc import Sequence
from math import degrees, tau

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue
from klann_ros.log.wording import verb

from .figures import SolverFigures

# Inputs are stale when there was none for so long [s].
STALE_AFTER = 2.0


def status(
    name: str,
    figures: SolverFigures,
    *,
    lost: int,
    lost_now: int,
    out_of_order: int,
    period: float,
    silence: float,
    min_transmission_angle: float,
    assembly: Sequence[int],
    sources: str = '',
    note: str = '',
) -> DiagnosticStatus:
    """
    Return the status of a leg.

    Parameters
    ----------
    name : str
        The status's name.
    figures : SolverFigures
        What happened since the last report.
    lost, lost_now : int
        Inputs lost since the start and since the last report.
    out_of_order : int
        Inputs older than the one before, since the start.
    period : float
        Time since the last report [s].
    silence : float
        Time since the last input [s].
    min_transmission_angle : float
        Below this a leg is worth a warning [rad].
    assembly : sequence of int
        The leg's assembly, which every published pose has.
    sources : str
        Who turns the crank, where it is more than one.
    note : str
        What is always worth saying about this leg.

    """
    level, message = _verdict(figures, lost_now, silence, min_transmission_angle, sources)
    if note:
        message = f'{message}; {note}'
    return DiagnosticStatus(
        level=level,
        name=name,
        message=message,
        hardware_id=name,
        values=[
            KeyValue(key=key, value=str(value))
            for key, value in _values(figures, lost, out_of_order, period, assembly).items()
        ],
    )


def _verdict(
    figures: SolverFigures,
    lost_now: int,
    silence: float,
    min_transmission_angle: float,
    sources: str,
) -> tuple[bytes, str]:
    """Return the level and the most important thing to say."""
    if silence > STALE_AFTER:
        return DiagnosticStatus.STALE, f'no input for {silence:.1f} s'
    if figures.failure:
        return DiagnosticStatus.ERROR, figures.failure
    if figures.rejection:
        return DiagnosticStatus.WARN, figures.rejection
    if lost_now or sources:
        were = verb(lost_now, 'input was', 'inputs were')
        lost = f'{lost_now} {were} lost' if lost_now else ''
        turned = f'the crank is turned by more than one: {sources}' if sources else ''
        return DiagnosticStatus.WARN, '; '.join(filter(None, (lost, turned)))
    if figures.from_singular < min_transmission_angle:
        angle = degrees(figures.from_singular)
        return (
            DiagnosticStatus.WARN,
            f'nearly singular: the links of a dyad are {angle:.1f} deg from in line',
        )
    return DiagnosticStatus.OK, 'solving'


def _values(
    figures: SolverFigures, lost: int, out_of_order: int, period: float, assembly: Sequence[int]
) -> dict[str, object]:
    angles = enumerate(figures.transmission_angles(len(assembly)), start=1)
    return {
        'solved': figures.solved,
        'rejected': figures.rejected,
        'failed': figures.failed,
        'lost': lost,
        'out_of_order': out_of_order,
        'rate': f'{figures.inputs / period:.3f}',
        'iterations': figures.iterations,
        'residual': f'{figures.residual:.3e}',
        'condition': f'{figures.condition:.4g}',
        **{f'transmission_angle_{i}': f'{mu:.6f}' for i, mu in angles},
        'branch': ' '.join(f'{sign:+d}' for sign in assembly),
    }


def missing_arcs(arcs: Sequence[tuple[float, float]]) -> str:
    """Return which crank angles are in none of a leg's arcs, in words; empty for a full turn."""
    ends = [(end, arcs[(i + 1) % len(arcs)][0]) for i, (_, end) in enumerate(arcs)]
    gaps = [f'{degrees(a) % 360:.2f} .. {degrees(b) % 360:.2f}' for a, b in ends]
    if len(arcs) == 1 and arcs[0][1] - arcs[0][0] >= tau:
        return ''
    return f'the crank does not turn fully, it cannot reach {", ".join(gaps)} deg'
