"""Malformed HTTP requests and endless WebSocket frames: counted, refused, logged in one line."""

import asyncio
from collections.abc import Callable
import logging
from time import monotonic
from typing import Any

from aiohttp import web
from aiohttp.http_exceptions import HttpProcessingError
from klann_ros.sanitize.text import printable_line

from .protocol import MAX_MESSAGE_SIZE

# Bytes since the last whole message of a socket: old releases of aiohttp assemble a frame before
# they check its size.
MAX_UNREAD = 64 * MAX_MESSAGE_SIZE
# Minimum time between two log lines [s].
LOG_PERIOD = 5.0


class RequestLog(logging.Logger):
    """
    The logger of aiohttp's request handler: malformed requests are counted, not logged one by one.

    aiohttp answers them with 400 and logs a traceback each. Errors of the handlers are logged as
    before.

    Parameters
    ----------
    warn : callable
        Logs one line; called from the server's thread, at most once in LOG_PERIOD.
    clock : callable
        Returns the time [s].

    """

    def __init__(
        self, warn: Callable[[str], object], clock: Callable[[], float] = monotonic
    ) -> None:
        super().__init__('aiohttp.server')
        self._warn, self._clock = warn, clock
        self._count = self._logged = 0
        self._reason = ''
        self._next = clock()

    def handle(self, record: logging.LogRecord) -> None:
        """Count a malformed request; pass all else to aiohttp's own logger."""
        error = record.exc_info[1] if record.exc_info else None
        if isinstance(error, HttpProcessingError):
            self.count(error.message)
        else:
            logging.getLogger(self.name).handle(record)

    def count(self, reason: str) -> None:
        """Count a malformed request, and log the count if a line is due."""
        self._count += 1
        lines = reason.strip().splitlines() or ['not HTTP']
        self._reason = printable_line(lines[0])[:120]
        if self._clock() >= self._next:
            self.close()

    def close(self) -> None:
        """Log the requests that were not logged yet."""
        if self._count == self._logged:
            return
        self._logged = self._count
        self._next = self._clock() + LOG_PERIOD
        self._warn(
            f'malformed HTTP requests refused so far: {self._count} (the last: {self._reason})'
        )


class UnreadLimit(asyncio.Protocol):
    """
    Close a socket that sends more than a message without completing one.

    It stands between the socket and aiohttp.
    """

    def __init__(self, request: web.Request) -> None:
        self.bytes = 0
        self._inner: Any = request.protocol
        self._transport: Any = request.transport
        if self._transport is not None:
            self._transport.set_protocol(self)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._inner, name)

    def data_received(self, data: bytes) -> None:
        """Forward the bytes that were sent."""
        self.bytes += len(data)
        if self.bytes > MAX_UNREAD:
            self._transport.abort()
        else:
            self._inner.data_received(data)

    def eof_received(self) -> Any:
        """Forward the end."""
        return self._inner.eof_received()

    def connection_lost(self, error: Exception | None) -> None:
        """Forward the loss."""
        self._inner.connection_lost(error)
        # Break the reference cycle with the transport.
        self._transport = None

    def pause_writing(self) -> None:
        """Forward a pause of writing."""
        self._inner.pause_writing()

    def resume_writing(self) -> None:
        """Forward the end of the pause."""
        self._inner.resume_writing()
