"""Writing runs that survive: files, folders, a thread of its own, and what becomes of messages."""
