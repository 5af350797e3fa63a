"""MCAP files of any recorder and in any state: bytes, records, chunks, a file."""
