"""The server of the live page: aiohttp in a thread of its own."""

import asyncio
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import replace
from errno import EADDRINUSE
from itertools import count
import logging
from threading import Event, Thread
from time import monotonic
from typing import Any, cast

from aiohttp import web, WSCloseCode, WSMsgType
from aiohttp.http_exceptions import HttpProcessingError
from klann_ros.sanitize.text import printable_line

from .clients import ChangeNotifier, Client, PageState
from .guard import ForbiddenError, Guard
from .live_page import FILES, HTML, list_page, note_page, POLICY
from .protocol import MAX_MESSAGE_SIZE
from .runs import PROGRAMS, Reviews

# Maximum number of clients.
MAX_CLIENTS = 200
# Bytes since the last whole message of a socket: old releases of aiohttp assemble a frame before
# they check its size.
MAX_UNREAD = 64 * MAX_MESSAGE_SIZE
# Minimum time between two log lines about malformed requests [s].
_LOG_PERIOD = 5.0
# A client is gone if it answers no ping for this time [s].
_HEARTBEAT = 20.0
# Shutdown timeout [s].
_CLOSE_TIMEOUT = 1.0
_HEADERS = {
    'Content-Security-Policy': POLICY,
    'Cache-Control': 'no-store',
    'Cross-Origin-Opener-Policy': 'same-origin',
    'Cross-Origin-Resource-Policy': 'same-origin',
    'Referrer-Policy': 'no-referrer',
    'X-Content-Type-Options': 'nosniff',
    'X-Frame-Options': 'DENY',
}
# A review brings its own policy; here it has no origin, so that no log's text is ever this
# server's page.
_REVIEW_POLICY = "sandbox allow-scripts; frame-ancestors 'none'"
_Handler = Callable[[web.Request], Awaitable[web.StreamResponse]]


class ServerError(Exception):
    """A server that cannot start; the text says why."""


class LiveServer:
    """
    Serve the live page, with a folder of runs unless it is ''; `warn` logs a line.

    Port 0 is any free one. A ServerError says why it cannot listen.
    """

    def __init__(
        self,
        guard: Guard,
        state: PageState,
        runs: str = '',
        warn: Callable[[str], object] = lambda _: None,
    ) -> None:
        self.guard = guard
        self._log = _RequestLog(warn)
        self._state = state
        self._runs = runs
        self._numbers = count(1)
        self._clients: set[web.WebSocketResponse] = set()
        self._refusal: Exception | None = None
        self._listening = Event()
        self._thread = Thread(target=self._run, name='server', daemon=True)
        self._thread.start()
        self._listening.wait()
        if self._refusal is not None:
            raise ServerError(str(self._refusal)) from self._refusal

    def close(self) -> None:
        """Stop the server, and notify the clients."""
        with suppress(RuntimeError):
            self._loop.call_soon_threadsafe(self._ended.set)
        self._thread.join(5.0 * _CLOSE_TIMEOUT)
        self._log.close()

    def _run(self) -> None:
        """Serve in a thread; where not even an event loop can be made, the start is refused."""
        try:
            asyncio.run(self._serve())
        except OSError as error:
            if self._listening.is_set():
                raise
            self._refusal = ServerError(_listen_error(error, self.guard))
        finally:
            self._listening.set()

    async def _serve(self) -> None:
        """Serve until `close`, in the thread of the server."""
        self._loop = asyncio.get_running_loop()
        self._ended = asyncio.Event()
        self._notifier = ChangeNotifier(self._state)
        runner = web.AppRunner(self._make_app(), access_log=None, logger=self._log)
        try:
            await runner.setup()
            site = web.TCPSite(runner, self.guard.host, self.guard.port)
            await site.start()
        except (OSError, OverflowError) as error:
            self._refusal = ServerError(_listen_error(error, self.guard))
            await runner.cleanup()
            return
        else:
            self.guard = replace(self.guard, port=runner.addresses[0][1])
            self._reviews = Reviews(self._runs)
        finally:
            self._listening.set()
        await self._ended.wait()
        self._reviews.close()
        with suppress(asyncio.TimeoutError):
            await asyncio.wait_for(self._close(runner, site), 2.0 * _CLOSE_TIMEOUT)

    async def _close(self, runner: web.AppRunner, site: web.TCPSite) -> None:
        await site.stop()
        closes = [
            asyncio.ensure_future(
                socket.close(code=WSCloseCode.GOING_AWAY, message=b'view_node has ended')
            )
            for socket in self._clients
        ]
        if closes:
            _, late = await asyncio.wait(closes, timeout=_CLOSE_TIMEOUT)
            for close in late:
                close.cancel()
        await runner.cleanup()

    def _make_app(self) -> web.Application:
        app = web.Application(middlewares=[self._checked], client_max_size=MAX_MESSAGE_SIZE)
        app.router.add_get('/', self._send_page)
        app.router.add_get('/static/{name}', self._send_file)
        app.router.add_get('/socket', self._serve_socket)
        app.router.add_get('/favicon.ico', self._no_icon)
        if self._runs:
            app.router.add_get('/runs', self._list_runs)
            app.router.add_get('/runs/{name}', self._send_review)
            app.router.add_get('/runs/{name}/{program}', self._send_review)
        return app

    @web.middleware
    async def _checked(self, request: web.Request, handler: _Handler) -> web.StreamResponse:
        """Answer a request after the checks of its host, site and token."""
        try:
            if len(request.headers.getall('Host', [])) != 1:
                self._log.count('not exactly one Host header')
                raise web.HTTPBadRequest
            self.guard.check_host(_single_header(request, 'Host'))
            # Links and bookmarks may lead to the page itself only.
            if request.path != '/':
                self.guard.check_site(_single_header(request, 'Sec-Fetch-Site'))
            if not request.path.startswith('/static/'):
                self.guard.check_reading(_token(request))
            response = await handler(request)
        except ForbiddenError as error:
            response = web.Response(status=403, text=f'{error}\n')
        except web.HTTPException as error:
            response = web.Response(status=error.status, text=f'{error.reason}\n')
        if not response.prepared:
            for name, content in _HEADERS.items():
                response.headers.setdefault(name, content)
        return response

    async def _send_page(self, _: web.Request) -> web.Response:
        return web.Response(text=HTML, content_type='text/html')

    async def _no_icon(self, _: web.Request) -> web.Response:
        return web.Response(status=204)

    async def _send_file(self, request: web.Request) -> web.Response:
        content_type, text = FILES.get(request.match_info['name'], ('', ''))
        if not content_type:
            raise web.HTTPNotFound
        return web.Response(text=text, content_type=content_type)

    async def _serve_socket(self, request: web.Request) -> web.StreamResponse:
        """Serve a page's WebSocket until it is closed."""
        self.guard.check_origin(_single_header(request, 'Origin'), _single_header(request, 'Host'))
        if len(self._clients) >= MAX_CLIENTS:
            return web.Response(status=503, text='too many pages look already\n')
        socket = web.WebSocketResponse(
            heartbeat=_HEARTBEAT,
            max_msg_size=MAX_MESSAGE_SIZE,
            compress=False,
            timeout=_CLOSE_TIMEOUT,
        )
        await socket.prepare(request)
        token = _token(request)
        client = Client(
            next(self._numbers),
            socket,
            self._state,
            self._notifier,
            may_drive=self.guard.may_drive(token),
            has_runs=bool(self._runs) and self.guard.check_token(token),
        )
        self._clients.add(socket)
        unread = _UnreadLimit(request)
        writer = asyncio.ensure_future(client.write())
        # It ends with its socket; its exception has no other reader.
        writer.add_done_callback(lambda done: done.cancelled() or done.exception())
        try:
            async for message in socket:
                unread.bytes = 0
                reason = (
                    client.handle(message.data) if message.type == WSMsgType.TEXT else 'no text'
                )
                if reason:
                    await socket.close(
                        code=WSCloseCode.POLICY_VIOLATION, message=reason.encode()[:100]
                    )
        finally:
            writer.cancel()
            self._clients.discard(socket)
            self._state.disconnected(client.number)
        return socket

    async def _list_runs(self, request: web.Request) -> web.Response:
        self._check_token(request)
        runs = await self._reviews.runs()
        rows = self._reviews.judged_rows(runs)
        page = list_page(runs, rows, self.guard.token)
        is_complete = all(run.name in rows for run in runs)
        headers = {} if is_complete else {'Refresh': '2'}
        return web.Response(text=page, content_type='text/html', headers=headers)

    async def _send_review(self, request: web.Request) -> web.StreamResponse:
        """Answer with the page of a run's review, or with a note until it is made."""
        self._check_token(request)
        program = request.match_info.get('program', 'review')
        if program not in PROGRAMS:
            raise web.HTTPNotFound
        noun = PROGRAMS[program]
        title = noun.capitalize()
        page = await self._reviews.page(request.match_info['name'], program)
        if page is None:
            raise web.HTTPNotFound
        if page.failure:
            note = note_page(title, page.failure)
            return web.Response(text=note, content_type='text/html', status=500)
        if page.done.is_set():
            headers = {'Content-Security-Policy': _REVIEW_POLICY}
            text = await asyncio.to_thread(page.file.read_text, encoding='utf-8')
            return web.Response(text=text, content_type='text/html', headers=headers)
        with suppress(asyncio.TimeoutError):
            await asyncio.wait_for(page.done.wait(), 1.0)
        note = note_page(title, f'The {noun} is being made; the page comes by itself.')
        return web.Response(text=note, content_type='text/html', headers={'Refresh': '0.2'})

    def _check_token(self, request: web.Request) -> None:
        if not self.guard.check_token(_token(request)):
            raise ForbiddenError('open the whole address that view_node printed')


def _single_header(request: web.Request, name: str) -> str | None:
    """Return a header; '' for several of that name."""
    values = request.headers.getall(name, [])
    return values[0] if len(values) == 1 else ('' if values else None)


def _token(request: web.Request) -> str | None:
    token: str | None = request.query.get('token')
    return token


def _listen_error(error: Exception, guard: Guard) -> str:
    text = getattr(error, 'strerror', None) or str(error)
    is_in_use = getattr(error, 'errno', None) == EADDRINUSE
    hint = '; --port 0 takes any that is free' if is_in_use else ''
    return f'cannot listen on {guard.host}, port {guard.port}: {text}{hint}'


class _RequestLog(logging.Logger):
    """
    The logger of aiohttp's request handler: malformed requests are counted, not logged one by one.

    aiohttp answers them with 400 and logs a traceback each. Errors of the handlers are logged as
    before. `warn` logs the count in one line, at most once in _LOG_PERIOD.
    """

    def __init__(self, warn: Callable[[str], object]) -> None:
        super().__init__('aiohttp.server')
        self._warn = warn
        self._count = self._logged = 0
        self._reason = ''
        self._next = monotonic()

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
        if monotonic() >= self._next:
            self.close()

    def close(self) -> None:
        """Log the requests that were not logged yet."""
        if self._count == self._logged:
            return
        self._logged = self._count
        self._next = monotonic() + _LOG_PERIOD
        self._warn(
            f'malformed HTTP requests refused so far: {self._count} (the last: {self._reason})'
        )


class _UnreadLimit:
    """Stand between a socket and aiohttp; close one that sends too much of one message."""

    def __init__(self, request: web.Request) -> None:
        self.bytes = 0
        self._inner: Any = request.protocol
        self._transport: Any = request.transport
        if self._transport is not None:
            # By __getattr__ it is a protocol to asyncio.
            self._transport.set_protocol(cast('asyncio.Protocol', self))

    def __getattr__(self, name: str) -> Any:
        return getattr(self._inner, name)

    def data_received(self, data: bytes) -> None:
        """Forward the bytes that were sent."""
        self.bytes += len(data)
        if self.bytes > MAX_UNREAD:
            self._transport.abort()
        else:
            self._inner.data_received(data)

    def connection_lost(self, error: Exception | None) -> None:
        """Forward the loss, and break the reference cycle with the transport."""
        self._inner.connection_lost(error)
        self._transport = None
