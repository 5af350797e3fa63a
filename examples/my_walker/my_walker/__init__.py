"""A package of launch and parameter files only."""
