"""The four-bar linkage: its dimensions, the course's equations, their solution, what it can do."""
