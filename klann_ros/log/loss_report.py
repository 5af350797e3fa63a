"""What can be said of the losses of a recording, and what cannot, in a sentence."""

from collections.abc import Mapping

from klann_ros.untrusted.text import listed

from .run_parameters import TopicCount
from .wording import counted, verb

_WHY = 'several published there at once, or their messages have no numbers'
# So many topics are named.
_MOST = 3


def losses_in_words(counts: Mapping[str, TopicCount]) -> str:
    """Return how many messages were lost, and of what nobody can tell."""
    lost = sum(count.lost or 0 for count in counts.values())
    early = sum(count.early for count in counts.values())
    unknown = [name for name, count in counts.items() if count.unheard is None]
    left = [name for name, count in counts.items() if count.left and count.unheard is not None]
    limited = ', as far as can be counted' if unknown or left else ''
    parts = [f'{lost} {verb(lost, "was", "were")} lost{limited}']
    if early:
        were = verb(early, 'was', 'were')
        parts.append(f'{early} {were} sent before the recorder heard their publishers')
    if left:
        number = sum(counts[name].left for name in left)
        publishers = counted(number, 'publisher')
        last = f'of what {verb(number, "it", "they")} sent last nothing is known'
        parts.append(f'{publishers} left ({listed(left, _MOST)}), and {last}')
    if unknown:
        parts.append(f'of {listed(unknown, _MOST)} nobody can tell: {_WHY}')
    return '; '.join(parts)
