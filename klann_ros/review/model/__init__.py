"""The model of a run: its recording, and figures derived from it."""
