"""Commands of the cranks, and what stops them; with motors that are slow, blocked or lost."""

from math import copysign, degrees, inf, nan, pi
from operator import mul
from random import Random

from hypothesis import given, settings, strategies as st
from klann_ros.gait import Feet, Rates, Steering, Twist2D
from klann_ros.walker import (
    ControllerSettings,
    CrankCommand,
    DiagnosticLevel,
    Fault,
    FaultKind,
    FaultLatch,
    ImuReading,
    MotionLimits,
    RefusalKind,
    WalkController,
    Walker,
)
from klann_ros.walker.control_laws import PhaseLock
from klann_ros.walker.controller import STANDS
from klann_ros.walker.feedback import CrankFeedback, Watchdog
from klann_ros.walker.limits import MotionLimiter
import numpy as np
import pytest

DT = 0.01


def turned(positions: list[float], rates: list[float]) -> list[float]:
    return [position + rate * DT for position, rate in zip(positions, rates, strict=True)]


class Bench:
    """A controller with motors; each turns at a factor of its commanded rate."""

    def __init__(self, steering: Steering, factors: list[float], **changes: object) -> None:
        settings = ControllerSettings(**changes)
        self.control = WalkController(steering, settings)
        self.factors = factors
        self.positions = [0.0] * len(factors)
        self.rates = [0.0] * len(factors)
        self.heard = [True] * len(factors)
        self.now = 0.0
        self.worst = 0.0
        self.min_rate = inf
        self.max_rate = -inf
        self.twist = (0.15, 0.0)
        self.commands = True
        self.shift = 0.0
        # Between the clocks of motors and controller [s].
        self.clock_offset = -40.0

    @property
    def readings(self) -> dict[str, tuple[float, float]]:
        readings = {}
        for k, crank in enumerate(self.control.cranks):
            if self.heard[k]:
                readings[crank.joint] = self.positions[k] + self.shift * k, self.rates[k]
        return readings

    def turn(self) -> None:
        self.positions = turned(self.positions, self.rates)

    def drive(self, command: CrankCommand | None) -> None:
        velocities = command.velocity if command else [0.0] * len(self.rates)
        self.rates = [*map(mul, self.factors, velocities)]
        self.min_rate = min(self.min_rate, *self.rates)
        self.max_rate = max(self.max_rate, *self.rates)

    def pause(self, seconds: float, *, held_after: float = inf) -> None:
        """Stop the controller; motors keep their rates, and messages wait in their queues."""
        queue = []
        for k in range(round(seconds / DT)):
            self.now += DT
            if k * DT >= held_after:
                self.rates = [0.0] * len(self.rates)
            self.turn()
            queue.append((self.now, self.readings))
        for k, (sent, readings) in enumerate(queue):
            # Ten messages between two commands, as a loop drains them.
            now = self.now + DT * (k // 10)
            age = now - sent + self.clock_offset
            self.control.feedback(readings, now, at=sent, transport_age=age)
            if self.commands:
                self.control.command(*self.twist, now, transport_age=age)
            if k % 10 == 9:
                self.drive(self.control.step(now))
                assert self.control.lock.errors == [0.0] * len(self.rates)
        self.now += DT * (len(queue) // 10)

    def run(self, seconds: float) -> 'Bench':
        self.worst = 0.0
        self.min_rate = inf
        self.max_rate = -inf
        for _ in range(round(seconds / DT)):
            self.now += DT
            age = self.clock_offset
            self.control.feedback(self.readings, self.now, transport_age=age)
            if self.commands:
                self.control.command(*self.twist, self.now, transport_age=age)
            self.drive(self.control.step(self.now))
            self.turn()
            self.worst = max(self.worst, *map(abs, self.control.lock.errors))
        return self

    @property
    def apart(self) -> float:
        """Return by how much the cranks are out of phase [deg]."""
        return degrees(abs(self.positions[0] - self.positions[1]))

    @property
    def verdict(self) -> tuple[DiagnosticLevel, str]:
        return self.control.verdict(self.now)


def test_a_walker_that_is_inactive_is_not_paused(steering: Steering) -> None:
    bench = Bench(steering, [1.0, 0.95]).run(3.0)
    bench.control.interlocks.is_active = False
    bench.run(2.0)
    assert bench.rates == [0.0, 0.0]
    bench.control.interlocks.is_active = True
    # It accelerates from standstill.
    assert bench.run(0.03).max_rate < 0.3
    bench.run(3.0)
    assert bench.rates == pytest.approx([0.15 / steering.speed] * 2, 0.1)
    assert bench.control.loop.pauses == 0
    assert not bench.control.events


def test_motors_five_percent_apart_keep_their_phases(steering: Steering) -> None:
    bench = Bench(steering, [1.0, 0.95]).run(2.0 * pi)
    assert bench.run(12.0).worst < 0.02
    assert bench.apart < 1.0
    assert bench.verdict == (DiagnosticLevel.OK, 'walking')


def test_without_the_lock_they_do_not(steering: Steering) -> None:
    bench = Bench(steering, [1.0, 0.95])
    bench.control.configure(ControllerSettings(phase_lock=False))
    assert bench.run(18.0).apart > 40.0


def test_a_learnt_motor_factor_holds_at_other_speeds(steering: Steering) -> None:
    bench = Bench(steering, [1.0, 0.9]).run(15.0)
    bench.twist = (-0.05, 0.0)
    bench.run(1.5)
    assert degrees(bench.run(5.0).worst) < 0.5


def test_straight_on_cranks_go_back_into_phase_slowly(steering: Steering) -> None:
    bench = Bench(steering, [1.0, 1.0])
    bench.positions = [0.0, 1.0]
    first = bench.run(2.0).apart
    assert 30.0 < first < degrees(1.0)
    assert bench.run(15.0).apart < 0.5


@pytest.mark.parametrize(
    ('senses', 'sides', 'start', 'rates'),
    [
        ((1.0, -1.0), (1.0, -1.0), [0.0, -1.0], [1.0, -1.0]),
        # In a curve those of one side.
        ((1.0,) * 4, (1.0, 1.0, -1.0, -1.0), [0.5, 0.0, 0.0, 0.5], [1.0, 1.0, 0.5, 0.5]),
    ],
)
def test_cranks_at_one_rate_go_back_into_phase(
    senses: tuple[float, ...], sides: tuple[float, ...], start: list[float], rates: list[float]
) -> None:
    lock = PhaseLock(senses, sides, ControllerSettings())
    lock.reset(start)
    for _ in range(3000):
        lock.step(DT, rates, lock.targets)
    times = np.divide(lock.targets, rates)
    assert times[::2] == pytest.approx(times[1::2], abs=0.01)


def test_in_a_curve_the_cranks_follow_their_planned_rates(steering: Steering) -> None:
    bench = Bench(steering, [1.0, 0.95])
    bench.twist = (0.1, 0.04)
    bench.run(10.0)
    assert bench.run(10.0).worst < 0.05
    assert bench.max_rate <= 3.0


def test_a_curve_that_is_too_fast_stays_the_same_curve(steering: Steering) -> None:
    limits = MotionLimits(max_linear=0.1, max_angular=1.0, max_crank_rate=1.0)
    bench = Bench(steering, [1.0, 1.0], limits=limits)
    bench.twist = (0.4, 0.2)
    bench.run(5.0)
    motion = bench.control.motion
    assert motion.angular / motion.linear == pytest.approx(0.5)
    assert max(map(abs, bench.rates)) <= 1.0
    level, text = bench.verdict
    assert level == DiagnosticLevel.WARN
    assert 'limited by max_linear' in text


def test_speed_changes_no_faster_than_it_may(steering: Steering) -> None:
    bench = Bench(steering, [1.0, 1.0], limits=MotionLimits(max_linear_acceleration=0.1))
    assert bench.run(0.5).control.motion.linear == pytest.approx(0.05, abs=0.003)
    # New limits are those of the stop that is under way.
    bench.twist = (0.0, 0.0)
    assert bench.run(0.1).control.motion.linear == pytest.approx(0.04, abs=0.003)
    bench.control.configure(ControllerSettings(limits=MotionLimits(max_linear_acceleration=1.0)))
    assert bench.run(0.1).rates == [0.0, 0.0]
    limits = MotionLimits(max_linear_acceleration=0.1, max_angular_acceleration=0.2)
    # The slower one holds both on the same curve.
    for commanded, motion in (
        (Twist2D(0.5, 0.1), (0.01, 0.002)),
        (Twist2D(0.1, 0.5), (0.004, 0.02)),
        (Twist2D(-0.001, 0.002), (-0.001, 0.002)),
    ):
        limiter = MotionLimiter(limits)
        assert limiter.approach(STANDS, commanded, 0.1) == pytest.approx(motion)


@pytest.mark.parametrize(
    ('wanted', 'motion', 'active'),
    [
        ((0.4, 0.4), (0.1, 0.1), ['max_linear', 'max_angular', 'max_crank_rate']),
        ((-0.2, 0.8), (-0.05, 0.2), ['max_linear', 'max_angular', 'max_crank_rate']),
        ((0.01, -0.05), (0.01, -0.05), []),
        # A limited curvature forbids turning on the spot.
        ((0.0, 0.2), (0.0, 0.0), ['max_curvature']),
        ((-0.02, -0.2), (-0.02, -0.1), ['max_curvature']),
    ],
)
def test_the_strictest_limit_counts(
    wanted: tuple[float, float], motion: tuple[float, float], active: list[str]
) -> None:
    limits = MotionLimits(max_linear=0.1, max_angular=0.2, max_curvature=5.0)
    limited = limits.motion(Twist2D(*wanted), lambda twist: Rates(0.0, 9.0 * twist.angular))
    assert limited == (pytest.approx(motion), active)


def test_a_rate_that_no_crank_has_is_taken_from_the_angles() -> None:
    for rate, taken in ((119.0, 119.0), (-121.0, 1.0), (nan, 1.0)):
        crank = CrankFeedback('crank', 12.0)
        for k in range(10):
            crank.read(DT * k, rate, DT * k, at=DT * k)
        assert crank.velocity == pytest.approx(taken)


@pytest.mark.parametrize('bad', [nan, inf, -inf])
def test_non_finite_inputs_are_rejected_and_counted(steering: Steering, bad: float) -> None:
    bench = Bench(steering, [1.0, 1.0]).run(2.0)
    moving = bench.control.motion
    for motion in ((bad, 0.0), (0.1, bad)):
        refusal = bench.control.command(*motion, bench.now)
        assert refusal.kind is RefusalKind.NOT_FINITE
    assert bench.control.commands.rejected == 2
    assert bench.control.motion == moving


def test_a_command_that_is_old_stops_it(steering: Steering) -> None:
    bench = Bench(steering, [1.0, 1.0]).run(2.0)
    bench.commands = False
    bench.run(0.4)
    assert min(bench.rates) > 0.5
    bench.run(1.0)
    assert bench.rates == [0.0, 0.0]
    assert bench.verdict == (DiagnosticLevel.OK, 'standing: no cmd_vel')


def test_a_crank_that_falls_silent_stops_all_and_is_named(steering: Steering) -> None:
    bench = Bench(steering, [1.0, 1.0]).run(2.0)
    bench.heard = [True, False]
    bench.control.measure_motion(STANDS, 0.1)
    assert bench.control.motion_feedback.lag != STANDS
    bench.run(0.5)
    assert bench.rates == [0.0, 0.0]
    assert bench.control.motion_feedback.lag == STANDS
    level, text = bench.verdict
    assert level == DiagnosticLevel.ERROR
    assert 'no valid feedback of right_crank' in text
    bench.heard = [True, True]
    bench.run(2.0)
    assert min(bench.rates) > 0.5
    assert bench.verdict[0] == DiagnosticLevel.OK


def test_without_feedback_of_every_crank_it_commands_nothing(steering: Steering) -> None:
    control = WalkController(steering, ControllerSettings())
    control.command(0.1, 0.0, 0.0)
    control.feedback({'left_crank': (0.0, 0.0)}, 0.0)
    assert control.step(0.0) is None
    assert 'right_crank yet' in control.verdict(0.0)[1]


@pytest.mark.parametrize('auto_reset', [False, True])
def test_a_blocked_crank_stops_all_until_a_deliberate_act(
    steering: Steering, *, auto_reset: bool
) -> None:
    bench = Bench(steering, [1.0, 1.0], auto_reset=auto_reset).run(2.0)
    bench.factors = [1.0, 0.0]
    bench.run(2.0)
    latch = bench.control.latch
    assert latch.fault[:2] == (FaultKind.NOT_TURNING, 'right_crank')
    level, text = bench.verdict
    assert level == DiagnosticLevel.ERROR
    assert 'right_crank does not turn' in text
    assert ('a cmd_vel of 0' in text) == auto_reset
    # The other one has waited for it.
    assert bench.apart < 25.0
    bench.factors = [1.0, 1.0]
    # A turn on the spot moves the cranks as well; both would, if it forgot the fault.
    for twist, seconds in (((0.15, 0.0), 1.0), ((0.0, 0.1), 0.5), ((0.0, 0.0), 0.1)):
        bench.twist = twist
        bench.run(seconds)
        assert (bench.min_rate, bench.max_rate) == (0.0, 0.0)
        assert latch.fault is not None
    bench.twist = (0.1, 0.0)
    bench.run(2.0)
    if not auto_reset:
        assert (bench.min_rate, bench.max_rate) == (0.0, 0.0)
        latch.reset()
        bench.run(2.0)
    assert min(bench.rates) > 0.3
    assert latch.fault is None


def test_the_first_fault_stays_and_names_what_resets_it() -> None:
    latch = FaultLatch()
    assert latch.reason == ''
    latch.trip(Fault(FaultKind.TILTED, '', 'tilted by 40 deg'))
    latch.trip(Fault(FaultKind.FROZEN, 'crank', 'frozen'))
    assert latch.reason == 'tilted by 40 deg; call ~/reset_fault'
    latch.auto_reset = True
    # It needs both, in this order, after the fault.
    for is_motion, is_tripped in ((True, True), (False, True), (False, True), (True, False)):
        latch.command(is_motion=is_motion)
        assert (latch.fault is not None) == is_tripped
    latch.command(is_motion=False)
    latch.trip(Fault(FaultKind.FROZEN, 'crank', 'frozen'))
    latch.command(is_motion=True)
    assert latch.reason.startswith('frozen; a cmd_vel of 0 and then a new one')


def test_a_pause_of_the_motors_blocks_no_crank(steering: Steering) -> None:
    bench = Bench(steering, [0.0, 0.0])
    bench.run(0.15)
    bench.heard = [False, False]
    bench.run(0.28)
    bench.heard = [True, True]
    bench.run(0.2)
    bench.factors = [1.0, 1.0]
    assert bench.run(2.0).verdict[1] == 'walking'


def test_all_wait_for_a_crank_that_cannot_keep_up(steering: Steering) -> None:
    bench = Bench(steering, [1.0, 0.4]).run(20.0)
    assert bench.apart < 25.0
    assert 0.3 < bench.control.lock.rate_scale < 1.0 or bench.worst < 0.1


@pytest.mark.parametrize('shift', [0.3, 1.5])
@pytest.mark.parametrize('readings', [1, 4, 5])
def test_five_readings_confirm_a_position_offset(shift: float, readings: int) -> None:
    crank = CrankFeedback('crank', 12.0)
    for k in range(100 + readings):
        offset = crank.read(DT * k + shift * (k >= 100), 1.0, DT * k)
        assert bool(offset) == (k == 104)
    assert crank.counts.offsets == (readings == 5)
    # The larger one is held back as long.
    assert crank.jump_filter.jumps == (shift > 1.0)
    assert crank.position == pytest.approx(DT * 99, abs=0.35 if readings < 5 else 1.6)


def test_an_encoder_jump_is_accepted_and_reported(steering: Steering) -> None:
    bench = Bench(steering, [1.0, 1.0]).run(2.0)
    bench.shift = 1.0
    bench.run(0.5)
    level, text = bench.verdict
    assert level == DiagnosticLevel.WARN
    assert 'right_crank: position offset of' in text
    # No motor is whipped round.
    assert max(map(abs, bench.rates)) < 1.5
    # From there it goes back into phase, as the encoder has it.
    bench.run(20.0)
    assert bench.control.lock.phases() == pytest.approx([0.0, 0.0], abs=0.01)


@settings(max_examples=40, deadline=None)
@given(turns=st.integers(-3, 3), rate=st.floats(-3.0, 3.0))
def test_an_encoder_that_begins_anew_after_a_turn_moves_no_crank(turns: int, rate: float) -> None:
    crank = CrankFeedback('crank', 12.0)
    for k in range(200):
        angle = rate * DT * k
        wrapped = angle % (2.0 * pi) + 2.0 * pi * turns
        crank.read(wrapped, None, k * DT)
    first = 2.0 * pi * turns
    assert crank.position - first == pytest.approx(rate * DT * 199, abs=1e-9)
    assert crank.jump_filter.jumps == 0


def test_one_motor_refuses_to_turn_and_walks_on(one_motor: Feet) -> None:
    control = WalkController(Steering(one_motor), ControllerSettings())
    assert control.command(0.1, 0.0, 0.0) is None
    refusal = control.command(0.1, 0.2, 0.0)
    assert refusal.kind is RefusalKind.CANNOT_TURN
    assert 'its legs share one crank' in refusal.text
    assert control.commands.refused == 1
    assert control.steering.rates(Twist2D(0.1, 0.2)).left > 0.0


@pytest.mark.parametrize(
    ('linear', 'seconds', 'held_after', 'ended'),
    [
        (0.15, 0.3, inf, False),
        (-0.15, 0.3, inf, True),
        (-0.15, 1.0, 0.5, False),
        (0.15, 1.0, inf, True),
        (0.15, 5.0, 0.5, True),
        (-0.15, 5.0, inf, False),
    ],
)
def test_after_a_pause_the_set_points_restart_where_the_cranks_are(
    steering: Steering, linear: float, seconds: float, held_after: float, ended: bool
) -> None:
    bench = Bench(steering, [1.0, 0.95])
    bench.twist = (linear, 0.0)
    bench.run(3.0)
    rate = 0.15 / steering.speed
    bench.commands = not ended
    bench.min_rate = inf
    bench.max_rate = -inf
    for _ in range(2):
        bench.pause(seconds, held_after=held_after)
    rates = [bench.min_rate, bench.max_rate]
    bench.run(3.0)
    rates += [bench.min_rate, bench.max_rate]
    slowest, fastest = sorted((0.0, copysign(1.1 * rate, linear)))
    assert slowest <= min(rates) <= max(rates) <= fastest
    assert bench.control.loop.pauses >= 1
    assert 'was paused for' in bench.control.events[-1]
    assert bench.rates == pytest.approx([0.0, 0.0] if ended else [copysign(rate, linear)] * 2, 0.1)


class StarvedWalk:
    """A walker and its motors on a loaded machine: both pause, and messages wait in queues."""

    PAUSES = (0.05, 0.15, 0.19, 0.23, 0.27, 0.4, 2.0)

    def __init__(self, steering: Steering, twist: tuple[float, float], seed: int) -> None:
        self.control = WalkController(steering, ControllerSettings())
        self.twist = twist
        self.random = Random(seed)  # noqa: S311 - load
        self.positions = [0.0, 0.0]
        self.rates = [0.0, 0.0]
        self.feedback: list[tuple[float, list[float], list[float]]] = []
        self.commands: list[CrankCommand] = []
        self.cmd_vel: list[float] = []
        # Of walker and motors: the end of the pause.
        self.resumes = [0.0, 0.0]
        self.resumed = 0.0
        self.walked = 0

    def is_paused(self, k: int, now: float) -> bool:
        if now >= max(1.0, self.resumes[k]) and self.random.random() < 0.03:
            self.resumes[k] = now + self.random.choice(self.PAUSES)
            if k == 0 and self.resumes[0] - now > 0.2:
                self.resumed = self.resumes[0]
        return now < self.resumes[k]

    def run(self, seconds: float) -> None:
        for tick in range(round(seconds / DT)):
            now = tick * DT
            # Motors keep their rates, and receive their commands one by one.
            self.positions = turned(self.positions, self.rates)
            if not self.is_paused(1, now):
                if self.commands:
                    self.rates = list(self.commands.pop(0).velocity)
                self.feedback.append((now, self.positions, self.rates))
            if tick % 10 == 0:
                self.cmd_vel.append(now)
            if not self.is_paused(0, now):
                self.wake(now)

    def wake(self, now: float) -> None:
        # A timer may be the first.
        if self.random.random() < 0.5:
            self.step(now)
        for sent, positions, rates in self.feedback:
            joints = [crank.joint for crank in self.control.cranks]
            readings = dict(zip(joints, zip(positions, rates, strict=True), strict=True))
            self.control.feedback(readings, now, at=sent, transport_age=now - sent)
            if self.random.random() < 0.1:
                self.step(now)
        for sent in self.cmd_vel:
            self.control.command(*self.twist, now, transport_age=now - sent)
        self.feedback = []
        self.cmd_vel = []
        self.step(now + DT / 2.0)

    def step(self, now: float) -> None:
        control = self.control
        last_targets = control.lock.targets
        control.events.clear()
        command = control.step(now)
        if command is None:
            return
        self.commands.append(command)
        self.walked += any(command.velocity)
        if any('set points restart' in event for event in control.events):
            assert min(crank.times.at for crank in control.cranks) >= self.resumed - 0.05
            assert control.lock.errors == [0.0, 0.0]
        if control.lock.errors == [0.0, 0.0] or not last_targets:
            return
        moves = np.subtract(command.position, last_targets)
        assert sum(moves) * self.twist[0] >= 0.0
        assert min(moves * command.velocity) >= 0.0


@pytest.mark.parametrize('twist', [(0.15, 0.0), (-0.1, 0.05), (0.1, -0.05), (0.1, 0.02)])
def test_on_a_loaded_machine_no_crank_turns_against_its_set_point(
    steering: Steering, twist: tuple[float, float]
) -> None:
    """
    Set points of both sides together never go back, and no crank turns against its set point.

    In a tight curve the set point of one side may go back, and the crank of the other side waits
    where it is ahead.
    """
    for seed in range(5):
        walk = StarvedWalk(steering, twist, seed)
        walk.run(6.0)
        assert walk.control.loop.pauses > 0
        assert walk.walked > 50


def test_a_pause_without_a_command_prolongs_no_motion(steering: Steering) -> None:
    bench = Bench(steering, [1.0, 1.0]).run(2.0)
    bench.commands = False
    bench.run(0.6)
    assert min(bench.rates) > 0.5
    bench.pause(0.25)
    assert bench.rates == [0.0, 0.0]


def test_a_command_that_is_old_or_waited_during_a_pause_is_late(steering: Steering) -> None:
    bench = Bench(steering, [1.0, 1.0]).run(2.0)
    refusal = bench.control.command(0.1, 0.0, bench.now, age=0.51)
    assert refusal.kind is RefusalKind.LATE
    assert 'clocks differ' in refusal.text
    assert bench.control.command(0.1, 0.0, bench.now, age=0.49) is None
    assert bench.control.commands.late == 1
    bench.commands = False
    bench.now += 5.0
    sent_before = bench.clock_offset + 4.9
    refusal = bench.control.command(0.1, 0.0, bench.now, transport_age=sent_before)
    assert 'waited' in refusal.text
    assert bench.run(0.5).max_rate == 0.0
    # One that is accepted has its age all the same.
    bench.now += 5.0
    assert bench.control.command(0.1, 0.0, bench.now, transport_age=sent_before - 4.5) is None
    assert bench.control.commands.is_old(bench.now + 0.2, 0.5)


def test_only_what_was_sent_before_the_end_of_a_pause_waited() -> None:
    watchdog = Watchdog()
    assert watchdog.delay(-40.0, 1.0) == 0.0
    watchdog.pause(2.0)
    # Sent at 1.95 s, and at 2.05 s; the second is late because the machine is busy.
    assert watchdog.delay(-39.9, 2.05) == pytest.approx(0.1)
    assert watchdog.delay(-39.9, 2.15) == 0.0


@pytest.mark.parametrize(('seconds', 'begins_anew'), [(0.25, False), (0.35, True), (1.4, True)])
def test_after_a_long_pause_it_starts_from_standstill(
    steering: Steering, seconds: float, *, begins_anew: bool
) -> None:
    bench = Bench(steering, [1.0, 1.0]).run(3.0)
    bench.pause(seconds)
    bench.run(0.05)
    # In 0.2 s at most, of which it may have walked half while the queue was drained.
    assert (bench.control.motion.linear < 0.07) == begins_anew
    assert bench.run(1.0).control.motion.linear == pytest.approx(0.15)


def test_a_queue_is_drained_within_a_second() -> None:
    watchdog = Watchdog()
    for now, transport_age in ((1.0, -40.0), (1.5, -40.0)):
        assert watchdog.delay(transport_age, now) == 0.0
    watchdog.pause(2.0)
    # A clock that was set by 2 s during the pause looks like a queue, but not for ever.
    assert watchdog.delay(-38.0, 2.9) == pytest.approx(2.0)
    assert watchdog.delay(-38.0, 3.1) == 0.0


@pytest.mark.parametrize('linear', [0.3, -0.3])
@pytest.mark.parametrize('angular', [0.0, 0.2, -0.2])
def test_no_crank_turns_faster_than_it_may_to_either_side(
    steering: Steering, linear: float, angular: float
) -> None:
    for motion in (Twist2D(linear, angular), Twist2D(0.0, angular)):
        limits = MotionLimits(max_linear=1.0, max_angular=1.0, max_crank_rate=0.8)
        bench = Bench(steering, [1.0, 1.0], limits=limits)
        bench.twist = tuple(motion)
        bench.run(8.0)
        assert -0.8 - 1e-9 <= bench.min_rate <= bench.max_rate <= 0.8 + 1e-9
        allowed, active = limits.motion(motion, steering.rates)
        assert max(map(abs, steering.rates(allowed))) <= 0.8 + 1e-9
        assert ('max_crank_rate' in active) == (max(map(abs, steering.rates(motion))) > 0.8)


@pytest.mark.parametrize('linear', [0.3, -0.3])
def test_set_points_turn_no_faster_than_cranks_may_to_either_side(
    steering: Steering, linear: float
) -> None:
    limits = MotionLimits(max_linear=1.0, max_crank_rate=0.8)
    bench = Bench(steering, [1.0, 1.0], limits=limits)
    bench.twist = (linear, 0.0)
    bench.run(3.0)
    for _ in range(200):
        last_targets = bench.control.lock.targets
        # The body stays behind, so that more than the limit is wanted.
        bench.control.measure_motion(STANDS, DT)
        bench.run(DT)
        moves = np.abs(np.subtract(bench.control.lock.targets, last_targets))
        assert max(moves) <= 0.8 * DT + 1e-9
    assert min(moves) > 0.7 * DT


@pytest.mark.parametrize('error', [2.0, 0.3, -0.3, -2.0])
@pytest.mark.parametrize('linear', [0.15, -0.15, 0.0])
def test_an_error_is_made_up_at_no_more_than_the_commanded_rate(
    steering: Steering, error: float, linear: float
) -> None:
    lock = WalkController(steering, ControllerSettings()).lock
    rate = linear / steering.speed
    lock.reset([0.0, error])
    for _ in range(100):
        command = lock.step(DT, [rate, rate], [0.0, 0.0])
        assert all(0.0 <= u * rate <= 2.5 * rate**2 for u in command.velocity)
        if not rate:
            assert command.velocity == (0.0, 0.0)


@pytest.mark.parametrize('error', [0.2, -1.0])
@pytest.mark.parametrize('rate', [0.25, -0.25])
def test_a_saturated_rate_does_not_change_the_learned_speed_error(
    steering: Steering, error: float, rate: float
) -> None:
    """A crank that stays behind, or ahead, by more than can be made up."""
    lock = WalkController(steering, ControllerSettings()).lock
    rates = [rate, rate]
    lock.reset([0.0, 0.0])
    for _ in range(200):
        positions = [target - copysign(error, error * rate) for target in lock.targets]
        velocities = lock.step(DT, rates, positions).velocity
    assert velocities != pytest.approx(rates)
    lock.reset([0.0, 0.0])
    assert lock.step(0.0, rates, [0.0, 0.0]).velocity == pytest.approx(rates)


class SteadyClock:
    """A clock that the test sets."""

    now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.mark.parametrize('feedback', [True, False])
def test_timeouts_pass_while_simulated_time_stands_still(
    steering: Steering, feedback: bool
) -> None:
    clock = SteadyClock()
    control = WalkController(steering, ControllerSettings(), clock)
    for k in range(200):
        clock.now += DT
        readings = dict.fromkeys(('left_crank', 'right_crank'), (0.5 * k * DT, 0.5))
        control.feedback(readings, k * DT)
        control.command(0.1, 0.0, k * DT)
        command = control.step(k * DT)
    assert min(command.velocity) > 0.3
    for _ in range(6):
        clock.now += 0.1
        if feedback:
            control.feedback(readings, 199 * DT)
        control.keep_alive(199 * DT)
    assert control.stop_reason(199 * DT)
    command = control.step(199 * DT)
    assert command.velocity == (0.0, 0.0)
    reason = 'the clock has stood still' if feedback else 'no valid feedback of left_crank'
    assert reason in control.verdict(199 * DT)[1]
    # Where the clock runs again, the command has timed out.
    clock.now += DT
    control.feedback(readings, 200 * DT)
    command = control.step(200 * DT)
    assert command.velocity == (0.0, 0.0)


def test_an_imu_times_out_while_simulated_time_stands_still(steering: Steering) -> None:
    clock = SteadyClock()
    walker = Walker(steering, imu_timeout=0.5, steady=clock)
    walker.imu(ImuReading(0.0, 0.0, 1.0), 1.0)
    assert walker.values(1.0)['imu'] == 'used'
    clock.now += 0.6
    assert walker.values(1.0)['imu'] == 'none'


@pytest.mark.parametrize('noise', [0.0, 0.002, 0.01])
@pytest.mark.parametrize('rated', [True, False])
@pytest.mark.parametrize('slip', [0.03, -0.1, 0.4, 0.46, -1.5])
def test_every_position_offset_above_the_noise_is_reported_once_with_its_size(
    noise: float, rated: bool, slip: float
) -> None:
    random = Random(1)  # noqa: S311 - noise
    crank = CrankFeedback('crank', 12.0)
    offsets = []
    position = 0.0
    for k in range(1000):
        # It accelerates, walks, stops, and starts again.
        phase = k * DT % 5.0
        rate = max(0.0, min(2.0 * phase, 1.0, 2.0 * (4.0 - phase)))
        position += rate * DT
        reading = position + random.gauss(0.0, noise) + slip * (k >= 700)
        if offset := crank.read(reading, rate if rated else None, k * DT):
            offsets.append((k, offset))
    if abs(slip) < 12.0 * noise:
        assert len(offsets) <= 1
        return
    ((k, offset),) = offsets
    assert 700 <= k < 710
    assert offset == pytest.approx(slip, abs=0.01 + 5.0 * noise)
    assert crank.counts.offsets == 1


def test_an_offset_has_its_size_where_readings_are_lost_while_the_crank_accelerates() -> None:
    # Half of the readings are lost: each rate is predicted for 20 ms and more.
    for seed in range(12):
        random = Random(seed)  # noqa: S311 - losses
        crank = CrankFeedback('crank', 12.0)
        offsets = []
        position = 0.0
        slip_tick = random.randint(300, 450)
        for k in range(800):
            phase = k * DT % 2.0
            position += max(0.0, min(3.0 * phase, 1.5, 3.0 * (2.0 - phase))) * DT
            reading = position + 0.2 * (k >= slip_tick)
            is_lost = k > 200 and random.random() < 0.5
            if not is_lost and (offset := crank.read(reading, None, k * DT, at=k * DT)):
                offsets.append(offset)
        assert offsets in ([], [pytest.approx(0.2, abs=0.03)])


def test_time_that_goes_back_begins_anew(steering: Steering) -> None:
    bench = Bench(steering, [1.0, 1.0]).run(2.0)
    bench.now = 0.0
    # The last command was of another time.
    bench.commands = False
    assert bench.run(0.3).max_rate == 0.0
    bench.commands = True
    assert bench.run(2.0).verdict == (DiagnosticLevel.OK, 'walking')
    watchdog = Watchdog()
    watchdog.feed(1000.0)
    assert [watchdog.age(now) for now in (1001.0, 0.0, 2.0)] == [1.0, 0.0, 2.0]


def test_a_zero_that_is_set_is_no_position_offset() -> None:
    crank = CrankFeedback('crank', 12.0)
    for tick in range(100):
        crank.read(0.4, 0.0, DT * tick)
    crank.shift(-0.4)
    for tick in range(100, 130):
        crank.read(0.0, 0.0, DT * tick)
    assert crank.counts.offsets == 0
    assert crank.detector.noise == crank.detector.min_noise
