"""`commission_node`: the first turns of motors."""
