"""The schedule of a playback: its timeline, its controls, and reading ahead."""
