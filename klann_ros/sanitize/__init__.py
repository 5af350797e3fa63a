"""What strangers give, made harmless once for all: texts that are shown, files that are read."""
