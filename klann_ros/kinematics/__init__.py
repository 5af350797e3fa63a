"""Kinematics of leg linkages; knows nothing of ROS."""
