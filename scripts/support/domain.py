"""A ROS domain without other users on this machine."""

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
import random
from socket import AF_INET, SOCK_DGRAM, socket

# Above 99 the ports fall into Linux's range of outgoing connections.
DOMAINS = range(1, 100)


@contextmanager
def own_domain() -> Iterator[int]:
    """Yield a domain id; while it is in use no other run gets the same one."""
    for domain in random.sample(DOMAINS, len(DOMAINS)):
        # DDS gives a domain 250 ports: 10 is the discovery of its first one, 249 is unused.
        # Binding 249 marks the domain as taken before any node starts.
        with socket(AF_INET, SOCK_DGRAM) as claim, socket(AF_INET, SOCK_DGRAM) as discovery:
            with suppress(OSError):
                claim.bind(('127.0.0.1', 7400 + 250 * domain + 249))
                discovery.bind(('127.0.0.1', 7400 + 250 * domain + 10))
                discovery.close()
            if discovery.fileno() < 0:
                yield domain
                return
    raise OSError('no ROS domain id from 1 to 99 is free on this machine')


@contextmanager
def own_world(work: Path) -> Iterator[dict[str, str]]:
    """Yield the variables of isolated nodes that log to `work`."""
    with own_domain() as domain:
        yield {
            'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
            'ROS_DOMAIN_ID': str(domain),
            'ROS_LOG_DIR': f'{work}/ros-log',
        }
