"""
Access control: which requests may read, and which may drive a leg.

A page of any web site can send requests to a server on this machine, open a socket to it and,
by a name that resolves to 127.0.0.1 (DNS rebinding), read the answers. So the Host header must
name this server; requests that open a socket or change something must have this server's Origin;
and commands must carry the session token, which only the printed URL has.
"""

from dataclasses import dataclass
from hmac import compare_digest
from ipaddress import ip_address, IPv4Address, IPv6Address
import secrets

LOOPBACK = ('127.0.0.1', 'localhost', '::1')
# Names of all addresses of a machine, and what a browser opens there.
ANY = {'0.0.0.0': '127.0.0.1', '::': '::1'}  # noqa: S104 - bound to only where the user gives it
# Default port of a web address.
_HTTP_PORT = 80
# No valid token is longer.
_MAX_TOKEN_LENGTH = 300


class ForbiddenError(Exception):
    """A request that is refused; the text says why, and repeats nothing of the request."""


def new_token() -> str:
    """Return a random session token of 192 bits, safe in a URL."""
    return secrets.token_urlsafe(24)


@dataclass(frozen=True)
class Guard:
    """The rules of one server."""

    # The address that it listens on, as given, and its port.
    host: str
    port: int
    token: str
    # Whether every change is refused, with the token as well.
    read_only: bool = False

    @property
    def is_local(self) -> bool:
        """Return whether only this machine can reach it."""
        address = _address(self.host)
        return self.host == 'localhost' or (address is not None and address.is_loopback)

    @property
    def url(self) -> str:
        """Return the address to open, with the token, which the runs need in any mode."""
        host = ANY.get(self.host, self.host)
        return f'http://{f"[{host}]" if ":" in host else host}:{self.port}/?token={self.token}'

    def check_host(self, host: str | None) -> None:
        """Refuse a request for another server, by its Host header, with a ForbiddenError."""
        name = (host or '').lower()
        port = f':{self.port}'
        if name.endswith(port):
            name = name.removesuffix(port)
        elif self.port != _HTTP_PORT:
            name = ''
        if name.startswith('[') and name.endswith(']'):
            name = name[1:-1]
        elif ':' in name:
            name = ''
        if not self._is_own(name):
            raise ForbiddenError('this server has another name')

    def check_origin(self, origin: str | None, host: str | None) -> None:
        """Refuse a request of no page of this server, by Origin and the checked Host header."""
        if origin is None or origin.lower() != f'http://{(host or "").lower()}':
            raise ForbiddenError('only the page of this server may ask for that')

    def check_site(self, site: str | None) -> None:
        """Refuse a request embedded in a page of another site (the Sec-Fetch-Site header)."""
        if site is not None and site not in {'same-origin', 'none'}:
            raise ForbiddenError('only the page of this server may ask for that')

    def check_token(self, token: str | None) -> bool:
        """Return whether a token is the right one, in constant time."""
        received = (token or '')[:_MAX_TOKEN_LENGTH].encode('utf-8', 'replace')
        return compare_digest(received, self.token.encode('ascii'))

    def check_reading(self, token: str | None) -> None:
        """Refuse a request without the token, unless only this machine can reach the server."""
        if not self.is_local and not self.check_token(token):
            raise ForbiddenError('open the whole address that view_node printed')

    def may_drive(self, token: str | None) -> bool:
        """Return whether a request with this token may change something."""
        return not self.read_only and self.check_token(token)

    def _is_own(self, name: str) -> bool:
        if self.host in ANY:
            # A name may be rebound by a foreign DNS server; a number cannot.
            return name in LOOPBACK or _address(name) is not None
        names = {self.host.lower()}
        return name in (names.union(LOOPBACK) if self.is_local else names)


def _address(name: str) -> IPv4Address | IPv6Address | None:
    try:
        return ip_address(name)
    except ValueError:
        return None
