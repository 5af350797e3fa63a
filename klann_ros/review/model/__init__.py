"""What a review knows of a run: what was recorded, and what follows from that."""
