"""What happened in a run, and whether it can be trusted."""
