"""`view_node`: topics and services on one side, the live page on the other."""
