"""Logs of runs: MCAP that every tool opens."""
