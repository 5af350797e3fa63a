"""Linkages of other programs: joints by coordinates, and the linkage file that they make."""
