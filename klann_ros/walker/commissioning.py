"""The first turns of cranks and IMU, one crank after the other; knows nothing of ROS."""

from cmath import phase
from collections.abc import Callable, Collection, Generator, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from math import atan2, degrees, hypot, radians
from statistics import fmean, pstdev
from typing import NamedTuple

from klann_ros.dynamics import GRAVITY
from klann_ros.gait import Feet, stance
from klann_ros.kinematics.angles import DEGREES, TURN, wrap
from klann_ros.robot import CrankDrive

from .crank_answers import CommissioningFinding, crank_findings, Turn, Verdict

# The rates of cranks by their joints, 0 for those without one [rad/s].
Rates = Mapping[str, float]
# A motion below this, or below this multiple of the standard deviation of noise, is none [rad].
MIN_ANGLE, NOISE_GATE = radians(0.1), 6.0
# A busy machine may disturb a turn: what slips, or turns too little, has to do so this often.
ATTEMPTS = 3
REPEATED_VERDICTS = {Verdict.SLIPPING, Verdict.RATIO}
# Readings in the mean of an IMU at rest.
REST_SAMPLES = 20
# A tilt of a body that stands on its feet, below which an IMU shows nothing [rad].
MIN_TILT = radians(0.3)


@dataclass(frozen=True)
class CommissioningSettings:
    """
    How cranks are turned: `angle` and `max_angle` [rad], `rate` [rad/s], times [s].

    Without feedback for `timeout` a turn ends, as it does where an encoder turns by `max_angle`.
    """

    angle: float = radians(10.0)
    max_angle: float = radians(30.0)
    rate: float = 0.2
    rest: float = 0.5
    timeout: float = 0.3


class ImuSample(NamedTuple):
    """Specific force [m/s^2] and angular velocity [rad/s] of an IMU at a time [s]."""

    at: float
    force: tuple[float, float, float]
    rates: tuple[float, float, float]


class _Encoder(NamedTuple):
    position: float
    velocity: float | None
    stamp: float
    at: float


class Commissioning:
    """
    Turn cranks one after the other, and judge their answers.

    `turn_all` and `home` yield the rates of the cranks, time after time; the caller commands them,
    sets `now` [s], and feeds the readings. `findings` and `drives` are the outcome, and
    `aborted` says why a motion ended early. `backwards` are the joints that were seen to turn
    backwards first, None if unknown.
    """

    def __init__(
        self,
        joints: Collection[str],
        settings: CommissioningSettings,
        backwards: Collection[str] | None = None,
    ) -> None:
        self._joints = joints
        self._settings = settings
        self._backwards = backwards
        self.now = 0.0
        self.findings: list[CommissioningFinding] = []
        self.drives = dict[str, CrankDrive]()
        self.aborted = ''
        self._zeroed = set[str]()
        # Angles of the encoders before the first turn [rad].
        self._first_positions: dict[str, float] = {}
        # Of the present turn, by joint; and all of the IMU.
        self._encoders: dict[str, list[_Encoder]] = {}
        self._imu: list[ImuSample] = []
        # Tilts of the first turn of each crank, by accelerometer and gyro: roll + j pitch [rad].
        self.tilts: dict[str, tuple[complex, complex]] = {}

    def feedback(self, encoders: Mapping[str, tuple[float, float | None]], stamp: float) -> None:
        """Take angles and rates of encoders [rad, rad/s], and the stamp of the message [s]."""
        for joint, (position, velocity) in encoders.items():
            self._encoders.setdefault(joint, []).append(
                _Encoder(position, velocity, stamp, self.now)
            )

    def imu(self, force: tuple[float, float, float], rates: tuple[float, float, float]) -> None:
        """Take the specific force [m/s^2] and the angular velocity [rad/s] of an IMU."""
        self._imu.append(ImuSample(self.now, force, rates))

    def turn_all(self) -> Iterator[Rates]:
        """Turn each crank forwards and back, and judge it."""
        yield from self._rest()
        for joint, encoders in self._encoders.items():
            self._first_positions[joint] = encoders[-1].position
        for joint in self._joints:
            if joint not in self._encoders:
                answering = ', '.join(self._encoders) or 'no joint'
                text = f'crank_state has {answering}: it is not turned'
                self.findings.append(CommissioningFinding(joint, Verdict.MISSING, text))
                continue
            # Its driver may have started since.
            self._first_positions.setdefault(joint, self._encoders[joint][-1].position)
            noise = pstdev(encoder.position for encoder in self._encoders[joint])
            min_angle = max(MIN_ANGLE, NOISE_GATE * noise)
            self.aborted = ''
            seen = None if self._backwards is None else joint in self._backwards
            for _ in range(ATTEMPTS):
                forwards = yield from self._turn(joint, self._settings.rate, self._settings.angle)
                back = yield from self._turn(joint, -self._settings.rate, forwards.commanded)
                findings, drive = crank_findings(
                    joint, (forwards, back), min_angle, is_backwards=seen
                )
                verdicts = {finding.verdict for finding in findings}
                if drive is not None or not verdicts & REPEATED_VERDICTS:
                    break
            self.findings += findings
            if self.aborted:
                self.findings.append(CommissioningFinding(joint, Verdict.ABORTED, self.aborted))
            if drive is not None:
                self.drives[joint] = drive

    def home(self, joint: str, is_closed: Callable[[], bool]) -> Iterator[Rates]:
        """Turn a crank forwards until its switch closes, and take its zero there."""
        yield from self._rest()
        drive = self.drives[joint]
        start = self._encoders[joint][-1].position
        self.aborted = ''
        was_closed = True
        while not self.aborted:
            last = self._encoders[joint][-1]
            last_but_one = self._encoders[joint][-2:][0]  # the same while it is the only one
            if is_closed() and not was_closed:
                edge = (last_but_one.position + last.position) / 2.0
                self._take_zero(joint, edge)
                break
            was_closed = is_closed()
            rotation = (last.position - start) / drive.encoder_ratio
            if abs(rotation) > 1.1 * TURN:
                self.aborted = 'its switch has not closed in a turn'
            elif self.now - last.at > self._settings.timeout:
                self.aborted = 'crank_state is silent'
            yield {joint: self._settings.rate * drive.motor_ratio}
        if self.aborted:
            del self.drives[joint]
            self.findings.append(CommissioningFinding(joint, Verdict.ABORTED, self.aborted))
        yield {}

    def set_zero(self) -> None:
        """Take the angles before the first turn as zeros: no crank comes back exactly."""
        for joint in self.drives:
            self._take_zero(joint, self._first_positions[joint])

    def _take_zero(self, joint: str, position: float) -> None:
        drive = self.drives[joint]
        zero = round(wrap(position / drive.encoder_ratio), 4)
        self.drives[joint] = replace(drive, zero=zero)
        self._zeroed.add(joint)

    def _rest(self) -> Iterator[Rates]:
        """Stand for a while; readings before it are forgotten but for the last."""
        for joint in self._encoders:
            del self._encoders[joint][:-1]
        begun = self.now
        while self.now - begun < self._settings.rest:
            yield {}

    def _turn(self, joint: str, rate: float, angle: float) -> Generator[Rates, None, Turn]:
        """Turn a crank by an angle, stand until it has stopped, and return the answers."""
        begun = self.now
        first_tilt = self._tilt()
        imu_count = len(self._imu)
        first = {name: encoders[-1] for name, encoders in self._encoders.items()}
        for encoders in self._encoders.values():
            encoders.clear()
        while self.now - begun < abs(angle / rate):
            reason = self._stop_reason(joint, first)
            if reason:
                self.aborted = reason
                break
            yield {joint: rate}
        commanded = rate * (self.now - begun)
        trace = self._encoders[joint][:]
        for name, encoders in self._encoders.items():
            encoders.insert(0, first[name])
        yield from self._rest()
        angle_changes = {
            name: (encoders[-1].position - first[name].position) / self._gear(name, joint)
            for name, encoders in self._encoders.items()
        }
        gyro = sum(complex(*sample.rates[:2]) for sample in self._imu[imu_count:])
        span = self._imu[-1].at - self._imu[imu_count].at if imu_count < len(self._imu) else 0.0
        gyro *= span / max(1, len(self._imu) - imu_count)
        self.tilts.setdefault(joint, (self._tilt() - first_tilt, gyro))
        return _answers(commanded, rate, angle_changes, trace)

    def _stop_reason(self, joint: str, first: Mapping[str, _Encoder]) -> str:
        """Return why a turn has to end, '' if it may go on."""
        angles = {}
        for name, encoders in self._encoders.items():
            last = encoders[-1] if encoders else first[name]
            if self.now - last.at > self._settings.timeout:
                return f'crank_state of {name} is silent'
            angles[name] = abs(last.position - first[name].position) / self._gear(name, joint)
        if max(angles.values()) > self._settings.max_angle:
            limit = degrees(self._settings.max_angle)
            return f'the turn ended early: an encoder turned by more than {limit:.0f} deg'
        # An encoder that exaggerates shows the play of a gear, but less than what turns.
        max_angle = max(self._settings.angle / 2.0, 2.0 * angles[joint])
        if max(angles.values()) > max_angle:
            return 'the turn ended early: another crank turns'
        return ''

    def _gear(self, name: str, tested: str) -> float:
        """Return the size of the ratio of an encoder beside the tested one, as far as known."""
        drive = None if name == tested else self.drives.get(name)
        return abs(drive.encoder_ratio) if drive else 1.0

    def _tilt(self) -> complex:
        """Return roll + j pitch by the mean specific force of the last rest [rad]."""
        x, y, z = self._force()
        return complex(atan2(y, z), atan2(-x, hypot(y, z)))

    def _force(self) -> tuple[float, ...]:
        last = [sample.force for sample in self._imu[-REST_SAMPLES:]]
        return tuple(map(fmean, zip(*last, strict=True))) if last else (0.0, 0.0, 0.0)

    @property
    def problem(self) -> str:
        """Return what has to be repaired before the first step, '' without anything."""
        joints = [joint for joint in self._joints if joint not in self.drives]
        joints += ['imu'] * any(finding.subject == 'imu' for finding in self.findings)
        return f'repair first: {", ".join(joints)}' if joints else ''

    @property
    def cranks(self) -> dict[str, dict[str, float]]:
        """Return the measured drives, as a robot file has them."""
        cranks = {joint: asdict(drive) for joint, drive in self.drives.items()}
        for joint, keys in cranks.items():
            if joint not in self._zeroed:
                del keys['zero']
        return cranks

    def judge_imu(self, feet: Feet | None) -> None:
        """Judge the IMU by gravity and by the tilts of a robot that stands on these feet."""
        if len(self._imu) < 2:
            return
        if len({(sample.force, sample.rates) for sample in self._imu}) == 1:
            self._imu_finding(Verdict.FROZEN_IMU, 'all readings are the same')
            return
        force = self._force()
        size = hypot(*force)
        if abs(size / GRAVITY - 1.0) > 0.2:
            unit = ': it is in units of gravity' if 0.8 < size < 1.2 else ''
            text = f'at rest its acceleration is {size:.3g} m/s^2, not 9.81{unit}'
            self._imu_finding(Verdict.UNITS, text)
        if force[2] < 0.87 * size:
            axis = max(range(3), key=lambda k: abs(force[k]))
            text = f'gravity is along its {"-" * (force[axis] < 0.0)}{"xyz"[axis]}, not z'
            self._imu_finding(Verdict.AXES, text)
            return
        tilts = [pair for pair in self.tilts.values() if abs(pair[0]) > MIN_TILT]
        square = sum(abs(tilt) ** 2 for tilt, _ in tilts)
        if not square:
            return
        gain = sum((tilt.conjugate() * gyro).real for tilt, gyro in tilts) / square
        if abs(gain / DEGREES - 1.0) < 0.5:
            text = f'its gyro is in deg/s: it shows {gain:.3g} of the tilt of the body'
            self._imu_finding(Verdict.UNITS, text)
        elif abs(gain - 1.0) > 0.5:
            text = f'its gyro shows {gain:.2f} of the tilt of the body: check its axes'
            self._imu_finding(Verdict.AXES, text)
        # An answer of a crank that is wired wrongly may be that of another one.
        if feet is not None and len(self.drives) == len(self._joints):
            self._judge_heading(feet)

    def _judge_heading(self, feet: Feet) -> None:
        """Compare the axis about which the body tilts with that of its file, at zero."""
        along = 0j
        for joint, (tilt, _) in self.tilts.items():
            angles = [predicted_tilt(feet, joint, sign * self._settings.angle) for sign in (1, -1)]
            predicted = min(angles, key=lambda angle: abs(abs(angle) - abs(tilt)))
            if min(abs(tilt), abs(predicted)) > 2.0 * MIN_TILT:
                along += tilt * predicted.conjugate()
        if along and abs(phase(along)) > radians(60.0):
            # Roll + j pitch of a body is turned against its IMU: within 5 deg.
            mounting_angle = -5 * round(degrees(phase(along)) / 5.0)
            text = f'it is turned about z by some {mounting_angle} deg'
            self._imu_finding(Verdict.AXES, text)

    def _imu_finding(self, verdict: Verdict, text: str) -> None:
        self.findings.append(CommissioningFinding('imu', verdict, text))


def predicted_tilt(feet: Feet, joint: str, angle: float) -> complex:
    """Return the change of roll + j pitch where a crank turns from zero [rad]; 0 if it falls."""
    tilts = []
    for crank in (0.0, angle):
        positions, _, centre = feet.at([crank * (name == joint) for name in feet.joints]).tolist()
        support = stance.support(positions, centre)
        if support is None:
            return 0j
        tilts.append(complex(support.roll, support.pitch))
    return tilts[1] - tilts[0]


def _answers(
    commanded: float, rate: float, angle_changes: Mapping[str, float], trace: Sequence[_Encoder]
) -> Turn:
    """Return the answers of a turn; `trace` is that of its encoder while it turned."""
    # A motor needs some time for its rate.
    middle = len(trace) // 2
    steady = trace[middle:]
    velocities = [encoder.velocity for encoder in steady if encoder.velocity is not None]
    span = steady[-1].at - steady[0].at if steady else 0.0
    slope = (steady[-1].position - steady[0].position) / span if span > 0.0 else 0.0
    stamps = {encoder.stamp for encoder in trace}
    return Turn(
        commanded,
        rate,
        angle_changes,
        fmean(velocities) if velocities else None,
        slope,
        is_repeated=len(trace) > 2 and len(stamps) == 1,
    )
