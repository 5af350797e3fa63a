"""`player_node`: a run back onto its topics."""
