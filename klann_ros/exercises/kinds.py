"""All kinds of exercises, by their name."""

from . import four_bar, klann, sliders, synthesis
from .variant import Kind

KINDS: dict[str, Kind] = {
    kind.name: kind for kind in (*klann.KINDS, *four_bar.KINDS, *sliders.KINDS, *synthesis.KINDS)
}
"""The kinds of exercises by their name."""
