"""All kinds of exercises, by their name."""

from .analysis import ANALYSIS_KEYS
from .synthesis import SYNTHESIS_KEYS
from .variant import Kind

KINDS: dict[str, Kind] = {
    name: Kind(name, *key_and_leg)
    for name, key_and_leg in (ANALYSIS_KEYS | SYNTHESIS_KEYS).items()
}
"""The kinds of exercises by their name."""
