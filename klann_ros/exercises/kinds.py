"""All kinds of exercises, by their name."""

from .four_bar import FOUR_BAR_KINDS
from .klann import KLANN_KINDS
from .sliders import SLIDER_KINDS
from .synthesis import SYNTHESIS_KINDS
from .variant import Kind

KINDS: dict[str, Kind] = {
    kind.name: kind for kind in (*KLANN_KINDS, *FOUR_BAR_KINDS, *SLIDER_KINDS, *SYNTHESIS_KINDS)
}
"""The kinds of exercises by their name."""
