"""The parameters of `sim_node`, besides those of its robot."""

from collections.abc import Mapping, Sequence
from typing import Any

from klann_ros.nodes.leg_declarations import ENCODERS
from klann_ros.nodes.parameters import Declaration, number, require
from klann_ros.twin import Floor, ImuSampling, Motors, Sensors

_FLOOR, _MOTORS = Floor(), Motors()
# What to do about a publisher of another type, by the type that is taken and the published one.
TYPE_REMEDIES = {
    ('sensor_msgs/msg/JointState', 'std_msgs/msg/Float64MultiArray'): (
        'command_type:=joint_state of walker_node'
    ),
}
WORLD = (
    Declaration('built', '', 'leg file with the lengths as built and the encoder zero'),
    number('friction', _FLOOR.friction, "Coulomb's, of the feet on the floor", 0.0, 10.0),
    number('slope', _FLOOR.slope, 'angle by which the floor rises along x [rad]', -0.785, 0.785),
    number('time_step', 0.0, 'of the engine [s]; 0: 1 ms, of a leg 0.2 ms', 0.0, 0.005),
    number('compliance', 0.0, 'time constant of joints that give way [s]; 0: rigid', 0.0, 0.05),
)
DRIVES = (
    Declaration(
        'motor_speed_factor',
        [1.0],
        "factor of the motors' speeds: one for all, or one for each crank joint",
        constraint='one number, or one for each crank joint, finite',
    ),
    number('motor_bandwidth', _MOTORS.bandwidth, "of a motor's speed [rad/s]", 0.1, 1000.0),
    number('max_crank_rate', _MOTORS.max_velocity, 'no crank turns faster [rad/s]', 1e-3, 100.0),
    number('command_timeout', 0.5, 'without a younger command a crank is held [s]', 0.01, 60.0),
)
READINGS = (
    number('encoder_noise', 0.0, 'standard deviation of crank angles [rad]', 0.0, 10.0),
    number('velocity_noise', 0.0, 'standard deviation of crank rates [rad/s]', 0.0, 100.0),
    number('encoder_offset', 0.0, 'constant error of all crank angles [rad]', -10.0, 10.0),
    number('gyro_noise', 0.0, "standard deviation of the IMU's rates [rad/s]", 0.0, 100.0),
    number(
        'accelerometer_noise',
        0.0,
        "standard deviation of the IMU's accelerations [m/s^2]",
        0.0,
        100.0,
    ),
    number('accelerometer_offset', 0.0, "bias of the IMU's accelerations [m/s^2]", -100.0, 100.0),
    number('orientation_noise', 0.0, "standard deviation of the IMU's attitude [rad]", 0.0, 3.2),
    Declaration(
        'imu_sampling',
        ImuSampling.MEAN.value,
        'whether the IMU reads the mean since its last reading, or an instant',
        choices=tuple(sampling.value for sampling in ImuSampling),
    ),
    number('camera_noise', 1e-4, 'standard deviation of measured points [m]', 0.0, 1.0),
    number('camera_outliers', 0.0, 'share of measured points that are wrong', 0.0, 0.5),
    Declaration('seed', 0, 'seed of all noise', limits=(0, 2**31 - 1)),
)
FAULTS = (
    Declaration('faults', '', 'what is wrong with it: NAME=SIZE@START [s], ..., such as dead@5'),
)
OUTPUT = (
    *ENCODERS,
    Declaration('cameras', False, 'whether cameras measure moving points, as camera/LEG/POINT'),
    Declaration('home_switches', False, 'whether zero of each crank closes a switch, home/JOINT'),
    number('linear', 0.0, 'own cmd_vel while no other node sends any [m/s]; 0: none', -1.0, 1.0),
    number('rate', 100.0, 'messages a second of simulated time [Hz]', 1.0, 1000.0),
    number('real_time_factor', 1.0, 'simulated time over wall time', 0.01, 100.0),
    Declaration('use_clock', False, 'publish /clock, and stamp messages with it'),
    # mujoco_ros2_control's has no other name, and a viewer shows it beside odom.
    Declaration('world_frame', 'odom', 'frame of ground_truth'),
    Declaration('base_frame', 'base_link', 'frame of the body, and of its IMU'),
    number('diagnostics_period', 1.0, 'time between diagnostics [s]', 0.01, 3600.0),
)
# By their titles in the help.
SIM_GROUPS = {'the world': WORLD, 'motors': DRIVES, 'sensors': READINGS, 'outputs': OUTPUT}
SIM_GROUPS['faults'] = FAULTS
SIM_PARAMETERS = (*WORLD, *DRIVES, *READINGS, *FAULTS, *OUTPUT)


def floor(parameters: Mapping[str, Any]) -> Floor:
    """Return the floor."""
    return Floor(friction=parameters['friction'], slope=parameters['slope'])


def motors(parameters: Mapping[str, Any], joints: Sequence[str]) -> Motors:
    """Return the motors; a StartError where there are not as many factors as joints."""
    factors = parameters['motor_speed_factor']
    requirement = f'one number, or {len(joints)}, one for each joint'
    require(len(factors) in (1, len(joints)), 'motor_speed_factor', factors, requirement)
    if len(factors) == 1:
        factors = factors * len(joints)
    speed_factors = dict(zip(joints, factors, strict=True))
    bandwidth, max_velocity = parameters['motor_bandwidth'], parameters['max_crank_rate']
    return Motors(bandwidth, max_velocity, speed_factors)


def sensors(parameters: Mapping[str, Any]) -> Sensors:
    """Return the sensor noise."""
    names = {reading.name for reading in READINGS} - {'seed', 'imu_sampling'}
    sampling = ImuSampling(parameters['imu_sampling'])
    return Sensors(imu_sampling=sampling, **{name: parameters[name] for name in names})
