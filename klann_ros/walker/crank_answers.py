"""
What the answer of an encoder says about a crank that was commanded to turn a little, alone.

The ratio k of the encoder's angle to the commanded one is the same both ways, unless the coupling
slips. A single encoder cannot tell what turned: with k < 0 the motor or the encoder is reversed,
which an eye can see. k > 1 is taken as an encoder before the gear. It is measured to some percent,
as the weight of the robot turns a crank a little: a gear has the nearest whole ratio.
"""

from collections.abc import Mapping
from enum import Enum
from typing import NamedTuple

from klann_ros.kinematics.angles import DEGREES, RPM
from klann_ros.robot import CrankDrive

# A ratio of deg or rpm to SI, within this relative error: few samples are taken of a fast one.
UNIT_ERROR = 0.35
# A ratio of 1, and equal ratios both ways, within these relative errors.
UNIT_RATIO_ERROR, SLIP = 0.2, 0.15
# The nearest whole ratio is that of the gear up to this one: errors are some percent.
MAX_CERTAIN_RATIO = 8.0
# A velocity is no noise above this part of the commanded one.
FROZEN_RATE = 0.25
# An encoder that answers for another one turns by this part of the commanded angle.
ANSWER = 0.3


class Verdict(Enum):
    """What a crank's or an IMU's answer is, in words."""

    OK = 'ok'
    MISSING = 'missing in crank_state'
    REPEATED = 'repeated messages'
    FROZEN = 'frozen encoder'
    DEAD = 'does not turn'
    SWAPPED = 'swapped'
    REVERSED = 'wrong sign'
    DEGREES = 'degrees'
    RPM = 'rpm'
    RATIO = 'gear ratio'
    SLIPPING = 'slipping'
    ABORTED = 'aborted'
    FROZEN_IMU = 'frozen IMU'
    UNITS = 'units of the IMU'
    AXES = 'axes of the IMU'


class CommissioningFinding(NamedTuple):
    """A verdict on a joint, or on 'imu', and a sentence about it."""

    subject: str
    verdict: Verdict
    text: str


class Turn(NamedTuple):
    """The answers of all encoders to a crank that was commanded to turn."""

    # Commanded angle [rad] and rate [rad/s], and changes of the encoders' angles by joint [rad].
    commanded: float
    rate: float
    angle_changes: Mapping[str, float]
    # Mean rate by the crank's messages; None if they have none. And that by its angles [rad/s].
    velocity: float | None
    slope: float
    # Whether stamps of its messages stood still.
    is_repeated: bool


def crank_findings(
    joint: str, turns: tuple[Turn, Turn], min_angle: float, *, is_backwards: bool | None
) -> tuple[list[CommissioningFinding], CrankDrive | None]:
    """
    Judge a crank that turned forwards and back; return findings and the drive as measured.

    Smaller angles than `min_angle` [rad] are noise. `is_backwards`: whether it was seen to turn
    backwards first; None if unknown. The drive is None if it cannot be determined.
    """
    forwards, back = turns
    if not forwards.commanded or not back.commanded:
        return [], None
    angle_change = forwards.angle_changes[joint]
    neighbours = {name: angle for name, angle in forwards.angle_changes.items() if name != joint}
    answers = [
        name for name in neighbours if abs(neighbours[name]) > ANSWER * abs(forwards.commanded)
    ]
    answering = max(answers, key=lambda name: abs(neighbours[name]), default=joint)
    if abs(angle_change) < min_angle:
        return [_still(joint, forwards, answering)], None
    if answering != joint and abs(neighbours[answering]) > abs(angle_change):
        return [_swapped(joint, answering)], None
    ratio, ratio_back = (
        angle_change / forwards.commanded,
        back.angle_changes[joint] / back.commanded,
    )
    if abs(ratio - ratio_back) > SLIP * abs(ratio) + 2.0 * min_angle / abs(back.commanded):
        text = f'{ratio:.2f} of the command forwards, {ratio_back:.2f} back: its coupling slips'
        return [CommissioningFinding(joint, Verdict.SLIPPING, text)], None
    ratio = (angle_change - back.angle_changes[joint]) / (forwards.commanded - back.commanded)
    of_velocity = _rate_findings(joint, forwards)
    findings = [*of_velocity, *_ratio_findings(joint, ratio)]
    if ratio < 0.0:
        findings.append(CommissioningFinding(joint, Verdict.REVERSED, _reversed(is_backwards)))
    elif is_backwards:
        text = 'motor and encoder are reversed: both count backwards'
        findings.append(CommissioningFinding(joint, Verdict.REVERSED, text))
    is_uncertain = not 1.0 - UNIT_RATIO_ERROR <= abs(ratio) <= MAX_CERTAIN_RATIO
    if of_velocity or is_uncertain or (ratio < 0.0 and is_backwards is None):
        return findings, None
    motor_sign = -1.0 if is_backwards else 1.0
    encoder_sign = motor_sign if ratio > 0.0 else -motor_sign
    drive = CrankDrive(encoder_sign * _gear_ratio(ratio), motor_sign)
    if not findings:
        text = f'its encoder answers {ratio:.2f} of the command'
        findings.append(CommissioningFinding(joint, Verdict.OK, text))
    return findings, drive


def _still(joint: str, turn: Turn, answering: str) -> CommissioningFinding:
    """Return why the angle of a crank did not change."""
    if turn.is_repeated:
        text = 'crank_state repeats a message: its stamp stands still'
        return CommissioningFinding(joint, Verdict.REPEATED, text)
    if answering != joint:
        return _swapped(joint, answering)
    if turn.velocity is not None and abs(turn.velocity) > FROZEN_RATE * abs(turn.rate):
        text = f'its angle stays, though its velocity is {turn.velocity:.2f} rad/s'
        return CommissioningFinding(joint, Verdict.FROZEN, text)
    text = 'neither angle nor velocity change: no power, a broken lead, a blocked leg'
    text += '; if you saw it turn, its encoder is frozen; commands in deg/s hardly move it'
    return CommissioningFinding(joint, Verdict.DEAD, text)


def _swapped(joint: str, answering: str) -> CommissioningFinding:
    text = (
        f'{answering} answers: exchange the motors, or the encoders, of the two; if only {joint} '
    )
    text += f'turned, first correct the encoder of {answering} (degrees, a gear)'
    return CommissioningFinding(joint, Verdict.SWAPPED, text)


def _rate_findings(joint: str, turn: Turn) -> list[CommissioningFinding]:
    """Return what is wrong with the velocity of an encoder beside its angle."""
    if turn.velocity is None or not turn.slope:
        return []
    factor = turn.velocity / turn.slope
    if abs(factor / RPM - 1.0) < UNIT_ERROR:
        return [
            CommissioningFinding(
                joint, Verdict.RPM, 'its velocity is in rpm: the driver has to convert it'
            )
        ]
    if factor < 0.5 or factor > 2.0:
        text = f'its velocity is {factor:.3g} of the change of its angle: the driver is wrong'
        return [CommissioningFinding(joint, Verdict.RATIO, text)]
    return []


def _ratio_findings(joint: str, ratio: float) -> list[CommissioningFinding]:
    """Return the finding about the ratio of a crank's rotation to its command, if it is not 1."""
    size = abs(ratio)
    if abs(size - 1.0) < UNIT_RATIO_ERROR:
        return []
    units = {
        'its angle is in degrees, or its encoder before a gear': DEGREES,
        'its driver takes commands as deg/s': 1.0 / DEGREES,
        'its driver takes commands as rpm': 1.0 / RPM,
    }
    for text, unit in units.items():
        if abs(size / unit - 1.0) < UNIT_ERROR:
            verdict = Verdict.RPM if unit == 1.0 / RPM else Verdict.DEGREES
            return [CommissioningFinding(joint, verdict, f'{text} ({size:.3g} of the command)')]
    if size > 1.0:
        text = f'its encoder turns about {size:.3g} times as far, before a gear'
        remedy = 'check it by the data sheet, and whether the crank itself turned so far'
        if size > MAX_CERTAIN_RATIO:
            remedy = 'too far to measure its ratio: set encoder_ratio by the data sheet'
        else:
            text += f' of {_gear_ratio(size):g}'
        return [CommissioningFinding(joint, Verdict.RATIO, f'{text}: {remedy}')]
    text = f'it turns {size:.3g} of the command: a gear, a weak motor or a slipping coupling'
    return [CommissioningFinding(joint, Verdict.RATIO, text)]


def _reversed(is_backwards: bool | None) -> str:
    if is_backwards is None:
        return (
            'motor leads or encoder are reversed: if it turned forwards first, it is the encoder. '
            'Run again with --backwards and the joints that turned backwards first, or none'
        )
    return 'its motor leads are exchanged' if is_backwards else 'its encoder counts backwards'


def _gear_ratio(ratio: float) -> float:
    """Return the nearest whole ratio of a gear."""
    return float(max(1, round(abs(ratio))))
