"""`drive`: sends test cranks, velocities and messages, and shows topics."""
