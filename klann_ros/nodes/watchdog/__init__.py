"""`watchdog_node`: zero for velocity controllers that have no timeout."""
