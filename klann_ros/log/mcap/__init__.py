"""MCAP files of any recorder and in any state: records, chunks, recovery, storage."""
