"""The Klann leg on ROS 2: kinematics, logs and their review, nodes."""

__version__ = '0.1.0'
