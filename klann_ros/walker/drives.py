"""Angles of cranks by their encoders, commands of their motors, and zeros that can be set."""

from collections.abc import Mapping
from dataclasses import replace

from klann_ros.kinematics.angles import wrap
from klann_ros.robot import CrankDrive

from .control_laws import CrankCommand
from .feedback import CrankFeedback

Readings = Mapping[str, tuple[float, float | None]]


class CrankDrives:
    """The encoders and motors of cranks, by their joints in the order of `Feet.joints`."""

    def __init__(self, drives: Mapping[str, CrankDrive]) -> None:
        self.drives = dict(drives)

    def measured(self, readings: Readings) -> Readings:
        """Return angles and rates of cranks by those of their encoders [rad, rad/s]."""
        measured = {}
        for joint, (position, velocity) in readings.items():
            measured[joint] = self.drives[joint].measured(position, velocity)
        return measured

    def commanded(self, command: CrankCommand) -> CrankCommand:
        """Return a command of cranks as one of their motors."""
        drives = self.drives.values()
        motors = [
            drive.commanded(angle, rate)
            for drive, angle, rate in zip(drives, command.position, command.velocity, strict=True)
        ]
        return CrankCommand(tuple(position for position, _ in motors), tuple(r for _, r in motors))

    @property
    def zeros(self) -> str:
        """Return the zeros as a robot file has them."""
        zeros = [f'{joint}: {{zero: {drive.zero:.4f}}}' for joint, drive in self.drives.items()]
        return f'cranks: {{{", ".join(zeros)}}}'

    def set_zero(self, crank: CrankFeedback) -> None:
        """Declare the present angle of a crank its zero."""
        drive = self.drives[crank.joint]
        zero = wrap(drive.zero + crank.position)
        crank.shift(drive.zero - zero)
        self.drives[crank.joint] = replace(drive, zero=zero)
