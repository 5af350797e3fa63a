"""
Settings of a walker's controller and odometry: what users set, and how both were tuned.

Users set the described fields, as parameters of walker_node. The fields below them are tuning: the
controller's was chosen by `benchmarks/walk.py --grid` on walker6_two_motors and
walker8_two_motors, the odometry's by `benchmarks/odometry.py` on walker6_two_motors and
walker_jansen alone. A comment that gives a bound or a reason is its source instead.
"""

from dataclasses import dataclass, field
from math import radians

from .limits import MotionLimits


@dataclass(frozen=True)
class ControllerSettings:
    """Limits, timeouts and gains of the controller."""

    limits: MotionLimits = field(default_factory=MotionLimits)  #: of its motion
    cmd_vel_timeout: float = 0.5  #: an older command stops it [s]
    feedback_timeout: float = 0.3  #: older feedback of any crank stops it [s]
    #: After a longer gap between two steps the set points restart at the measured angles [s].
    max_gap: float = 0.2
    phase_lock: bool = True  #: whether cranks are kept in phase by their feedback
    phase_gain: float = 4.0  #: P of the phase lock [1/s]
    phase_integral: float = 4.0  #: I of the phase lock [1/s^2]
    #: The part of its rate by which a crank goes faster or slower to get back into phase.
    rephase: float = 0.1
    motion_gain: float = 0.5  #: K of the motion feedback; 0 for no correction [1/s]
    #: A crank that does not follow its command over this path is a fault [rad].
    max_following_error: float = 0.15
    max_tilt: float = radians(30.0)  #: a larger tilt of the body, by its IMU, is a fault [rad]
    #: Whether a motion that is commanded after a command of 0 resets a fault.
    auto_reset: bool = False
    #: A longer silence of an emergency stop, once heard, stops it; at 0 none does [s].
    e_stop_timeout: float = 1.0
    max_effort: float = 0.0  #: a larger effort of a crank, for a time, stops it; at 0 none [N m]
    # The largest correction of the speed straight on, and by how much it is reduced in curves, as
    # a part of the command; the largest lag straight on, of which K times makes this part of it.
    max_correction: float = 0.5
    max_windup: float = 3.0
    # In curves a correction may exceed the command by this part of the motion at 1 rad/s.
    curve_correction: float = 0.5
    # The largest ratio of corrected to commanded yaw rate on the spot, and of commanded to
    # corrected; and K there, where the yaw comes evenly, as a multiple of K.
    max_spot_ratio: float = 2.0
    spot_gain: float = 3.0
    # All cranks slow down for one that lags by the first, and stop for one by the second [rad].
    error_slowdown: float = 0.1
    error_stop: float = 0.3
    # Greatest relative speed error of a motor that is learned, and the crank rate below which
    # little is [rad/s].
    integral_limit: float = 0.4
    learning_rate: float = 0.2
    # Time constant of small phase corrections [s].
    rephase_time: float = 1.0
    # Of the crank rates [rad/s^2]: half of what the encoders' offset detector takes for a step.
    max_crank_acceleration: float = 15.0
    # A crank below this rate stands [rad/s].
    creep_rate: float = 0.05


@dataclass(frozen=True)
class OdometryNoise:
    """Uncertainties of the estimator: standard deviations and noise densities."""

    #: Friction coefficient of the feet, unknown: between wet tile and rubber on concrete.
    friction: float = 0.6
    #: A foot that sticks creeps by less than this: 0.001 on hard ground, 0.05 on soft [m/s].
    stiction_speed: float = 0.001
    #: Density, with errors of the measured attitude and of scale [m/s^2/sqrt(Hz)].
    accelerometer_noise: float = 0.003
    gyro_noise: float = 5e-4  #: density [rad/s/sqrt(Hz)]
    accelerometer_bias: float = 0.3  #: before the first standstill [m/s^2]
    gyro_bias: float = 0.005  #: before the first standstill [rad/s]
    accelerometer_drift: float = 0.0015  #: random walk of the bias [m/s^2/sqrt(s)]
    gyro_drift: float = 2e-5  #: random walk of the bias [rad/s/sqrt(s)]
    standstill_yaw_rate: float = 0.0005  #: at standstill, as feet creep on soft ground [rad/s]
    heading_error: float = 0.005  #: of an IMU's yaw whose message gives no covariance [rad]
    advance_error: float = 0.01  #: relative error of the advance
    slip_error: float = 0.11  #: error of the motion, relative to the slip
    slip_yaw_error: float = 0.085  #: of the rotation at the feet's reach, relative to the slip
    #: Error relative to the difference between least squares and the friction law.
    contact_error: float = 0.5
    height_error: float = 0.01  #: of the pose on its feet [m]
    tilt_error: float = 0.02  #: of the pose on its feet [rad]
    # Information of friction on the velocity of the body: K [s/m^2]. It sets the scale of the
    # covariance of the velocity: noise of 3 mm/s of a foot that sticks, in a step of 10 ms.
    friction_information: float = 3e4
    # Density of the noise of the feet's measured velocities, alike for all [m/s/sqrt(Hz)].
    foot_velocity_noise: float = 7e-4
    # Slip errors with a gyro, and with an accelerometer as well, as parts of those without.
    slip_scale_with_gyro: float = 0.5
    slip_scale_with_accelerometer: float = 0.025
    # With an accelerometer: mean creep of feet that stick, as a part of the stiction speed.
    creep_error: float = 0.5
    # Without an accelerometer the body's rocking is unknown: error of the velocity at an instant
    # as a part of it, scaled as slip errors are with one. The pose averages it.
    rocking_error: float = 0.4
    # Largest crank angle of an integration step [rad]; after a longer time the velocity is unknown
    # [s].
    longest_step: float = 0.05
    max_step_time: float = 0.1
    # Time constant of the complementary filter of crank angles and rates [s]; a larger difference
    # between prediction and reading bypasses it [rad]. And that of gyro and orientation [s].
    encoder_filter_time: float = 0.3
    encoder_gate: float = 0.1
    orientation_filter_time: float = 0.5
    # Time constants: tipping onto other feet without an IMU, the acceleration that shifts the load
    # between the feet, the slope, and the mean innovation [s].
    tilt_time: float = 0.03
    load_shift_time: float = 0.05
    slope_time: float = 10.0
    innovation_time: float = 1.0
    # The mean innovation of the accelerometer, as a part of the largest friction, that is usual: a
    # larger one makes its noise larger, up to this factor of its variance, with which it measures
    # no more than friction does; then it is rejected for a while, at most for the third [s].
    expected_innovation: float = 0.15
    max_noise_factor: float = 2000.0
    max_rejection: float = 60.0
    # Root mean squares of it, and of the normalised innovation of the tilt, where the contact
    # model holds: beyond them errors grow with their squares. While the body tips it counts as
    # the last only.
    usual_innovation: float = 0.025
    usual_tilt: float = 0.08
    tipping_innovation: float = 0.5
    # A longer gap between readings of the IMU invalidates the interval [s], and so does one that
    # exceeds the usual gap by this factor: the impact of a foot may be lost with a message. Larger
    # impulses are rejected: the largest horizontal impact seen was a seventh of it [m/s].
    max_reading_gap: float = 0.03
    dropout_ratio: float = 1.8
    max_impulse: float = 1.0
    # An IMU is frozen whose readings repeat for this time, while the cranks move [s]. Over the
    # window [s] the turn of the gyro differs from that of the feet by less than the gate [rad],
    # this part of the slip by the reach and the turn itself; straight on by this at least [rad].
    # An IMU that is right again for the last time is used again [s].
    max_repetition: float = 0.2
    yaw_window: float = 8.0
    yaw_gate: float = 0.07
    yaw_slip_gate: float = 0.3
    max_straight_turn: float = 1.0
    imu_recovery_time: float = 2.0
    # Standstill: cranks and body turn slower than this [rad/s], cranks by less than this [rad],
    # for this time before anything is measured [s]. Means over that time shift by less than this
    # [rad] and this number of standard deviations. And the normalised innovation of the gyro's
    # bias beyond which nothing is learned.
    stationary_rate: float = 0.1
    stationary_angle: float = 0.02
    settling_time: float = 0.5
    stationary_shift: float = 0.004
    standstill_gate: float = 4.0
    bias_gate: float = 6.0
    # A larger mean at standstill means other units or axes, or missing gravity [m/s^2].
    max_accelerometer_bias: float = 1.0
    # Inconsistency with the centre of mass of the file that is reported: the body is on feet that
    # are beside it by this [m], for this part of the time; and the normalised innovation of the
    # tilt. Over 168 simulated walks with the right one (benchmarks/support/odometry_walks.py) the
    # latter are at most 0.17 and 4.0.
    max_outside: float = 0.01
    max_support_violation: float = 0.25
    max_tilt_innovation: float = 5.0
