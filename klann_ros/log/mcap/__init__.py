"""
MCAP files of any recorder and in any state: bytes, records, chunks, a file.

What reads bytes raises a DamagedError where these do not hold what they should, with what is wrong
and where; whoever goes through a file notes it, and goes on.
"""
