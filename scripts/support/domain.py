"""A ROS domain that nobody else on this machine uses."""

from collections.abc import Iterator
from contextlib import contextmanager
import random
import socket

from command_error import CommandError

# Above 99 the ports would fall into the range that Linux gives to outgoing connections.
DOMAINS = range(1, 100)


@contextmanager
def own_domain() -> Iterator[int]:
    """Yield a domain id; while it is in use no other run gets the same one."""
    for domain in random.sample(DOMAINS, len(DOMAINS)):
        # DDS gives a domain 250 ports: 10 is the discovery of its first participant, and 249 that
        # of none. That one says that the domain is taken, before any node has come up.
        first = 7400 + 250 * domain
        with _bound(first + 249) as reserved:
            if reserved and _is_free(first + 10):
                yield domain
                return
    raise CommandError('no ROS domain id from 1 to 99 is free on this machine')


@contextmanager
def _bound(port: int) -> Iterator[bool]:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as holder:
        try:
            holder.bind(('127.0.0.1', port))
        except OSError:
            yield False
        else:
            yield True


def _is_free(port: int) -> bool:
    with _bound(port) as free:
        return free
