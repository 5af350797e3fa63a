"""`crank_node`: what turns the crank."""
