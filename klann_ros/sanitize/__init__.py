"""Safe handling of untrusted input: texts to print, files, YAML, CDR messages and paths."""
