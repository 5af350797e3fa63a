"""`solver_node`: crank angle in, poses of the legs out."""
