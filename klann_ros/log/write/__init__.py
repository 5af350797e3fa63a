"""Crash-safe recording of runs: files, writer thread, drop counters, sessions and events."""
