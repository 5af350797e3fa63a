"""The path of a leg's foot: its figures, its stance, and which crank angle puts it where."""
