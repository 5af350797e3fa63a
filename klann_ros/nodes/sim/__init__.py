"""`sim_node`: the robot, for whoever has none."""
