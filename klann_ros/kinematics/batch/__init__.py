"""Many poses at once: whole arrays of crank angles, for one Klann leg or for many."""
