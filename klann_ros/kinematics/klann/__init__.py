"""The Klann leg: its dimensions, its equations in the course's letters, and their solution."""
