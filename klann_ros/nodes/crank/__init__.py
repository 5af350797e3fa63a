"""`crank_node`: the driver of the crank."""
