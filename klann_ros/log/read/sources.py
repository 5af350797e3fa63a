"""The parts of a log that can be read one by one, merged into one course of messages."""

from collections import deque
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
import heapq
from typing import TypeAlias

from klann_ros.log.records import Message

Topics: TypeAlias = Collection[str] | None


# So many more messages than are wanted are kept at most while the last ones are looked for.
SLACK = 100


@dataclass(frozen=True)
class Source:
    """Messages that are read together: a chunk of an index, or a whole file that has none."""

    # Log time of the earliest and the latest message [ns].
    start: int
    end: int
    # Yields the messages of some topics, of all for None.
    read: Callable[[Topics], Iterator[Message]]


def in_time_order(sources: Sequence[Source], topics: Topics) -> Iterator[Message]:
    """
    Merge sources by log time, each started when its time has come.

    That way only chunks that overlap are unpacked at the same time.
    """
    waiting = deque(sorted((source.start, number) for number, source in enumerate(sources)))
    started: list[tuple[int, int, Message, Iterator[Message]]] = []
    while waiting or started:
        if waiting and (not started or waiting[0] <= started[0][:2]):
            _, number = waiting.popleft()
            messages = sources[number].read(topics)
        else:
            _, number, message, messages = heapq.heappop(started)
            yield message
        following = next(messages, None)
        if following is not None:
            heapq.heappush(started, (following.log_time, number, following, messages))


def latest(sources: Sequence[Source], counts: Mapping[str, int], before: int) -> list[Message]:
    """
    Return the last messages of topics before a log time [ns], in order, so many of each.

    It goes back from there, and unpacks only what may still hold one that is wanted.
    """
    kept: dict[str, list[Message]] = {name: [] for name in counts}
    earlier = (source for source in sources if source.start < before)
    for source in sorted(earlier, key=lambda source: source.end, reverse=True):
        missing = {
            name
            for name, found in kept.items()
            if len(found) < counts[name] or found[0].log_time <= source.end
        }
        if not missing:
            break
        for message in source.read(missing):
            name = message.topic.name
            if message.log_time < before:
                kept[name].append(message)
                # A file without an index may hold any number of them.
                if len(kept[name]) > 2 * counts[name] + SLACK:
                    kept[name] = _last(kept[name], counts[name])
        for name in missing:
            kept[name] = _last(kept[name], counts[name])
    return _last([message for found in kept.values() for message in found], sum(counts.values()))


def _last(messages: list[Message], count: int) -> list[Message]:
    first = max(0, len(messages) - count)
    return sorted(messages, key=lambda message: message.log_time)[first:]
