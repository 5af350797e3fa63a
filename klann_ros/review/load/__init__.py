"""From a log to a recording: messages in bulk, whose they are, and how they came."""
