"""The foot path of a leg: its extent, stances and inverse problem."""
