"""A review as one HTML page that opens offline: what stands in it, and what moves in it."""
