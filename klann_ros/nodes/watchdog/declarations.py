"""The parameters of `watchdog_node`."""

from klann_ros.nodes.parameters import Declaration, number

WATCHDOG_PARAMETERS = (
    Declaration(
        'joints',
        [''],
        'joints of the controller, which takes as many numbers',
        constraint='the names of its joints',
    ),
    number('command_timeout', 0.5, 'without a younger command zero is sent [s]', 0.01, 60.0),
    number('diagnostics_period', 1.0, 'time between diagnostics [s]', 0.01, 3600.0),
)
# What to do about a publisher of another type, by the type that is taken and the published one.
TYPE_REMEDIES = {
    ('std_msgs/msg/Float64MultiArray', 'sensor_msgs/msg/JointState'): (
        'command_type:=velocities of walker_node'
    ),
}
