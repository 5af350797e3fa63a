"""
Modules that the Python of a browser (Pyodide) has not, or only on request; None there.

Without `resource` no limit is known, and without `lz4` or `zstandard` only uncompressed chunks are
read.
"""

try:
    import resource
except ImportError:
    resource = None  # type: ignore[assignment]
try:
    from lz4 import frame as lz4_frame  # type: ignore[import-untyped] # lz4 has no types
except ImportError:
    lz4_frame = None
try:
    import zstandard
except ImportError:
    zstandard = None  # type: ignore[assignment]

__all__ = ['lz4_frame', 'resource', 'zstandard']
