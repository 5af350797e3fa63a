"""`recorder_node`: leg topics in, a run out."""
