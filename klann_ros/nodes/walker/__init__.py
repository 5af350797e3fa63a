"""`walker_node`: cmd_vel in, cranks and odom out."""
