"""Safe handling of untrusted input: texts to print, files and paths, YAML, CDR messages."""
