"""`sim_node`: the simulated robot."""
