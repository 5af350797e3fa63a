"""No request of others is accepted, and none stops the page of the server's user."""

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
import errno
from inspect import signature
import json
import os
from pathlib import Path
import struct
from typing import Any

import aiohttp
from coroutine_thread import run_alone
from fake_live_state import FakeState, Served
from klann_ros.live.guard import Guard
from klann_ros.live.protocol import MAX_MESSAGE_SIZE
from klann_ros.live.server import LiveServer, MAX_UNREAD, ServerError
from multidict import CIMultiDict
import pytest
from yaml_tables import read_table

TAKE = {'id': 1, 'command': 'take', 'target': 'crank:/crank_angle'}
PATIENCE = 20.0
REQUESTS = read_table(Path(__file__).with_name('hostile_requests.yaml'))
Session, Socket = aiohttp.ClientSession, aiohttp.ClientWebSocketResponse


def attacking(test: Callable[..., Awaitable[None]]) -> Callable[..., None]:
    """Run a test with a session in an event loop of its own, up to a timeout."""
    test_signature = signature(test)
    fixtures = [
        parameter for name, parameter in test_signature.parameters.items() if name != 'session'
    ]

    def run(**fixture_values: Any) -> None:
        async def alone() -> None:
            async with aiohttp.ClientSession() as session:
                own_session = (
                    {'session': session} if len(fixtures) < len(test_signature.parameters) else {}
                )
                await asyncio.wait_for(test(**fixture_values, **own_session), PATIENCE)

        run_alone(alone())

    run.__name__ = test.__name__
    run.__signature__ = test_signature.replace(parameters=fixtures)  # type: ignore[attr-defined]
    return run


def headers(served: Served, **changes: str | None) -> dict[str, str]:
    """Return what the page's own browser sends, but for some of it."""
    own = {'Origin': f'http://{served.place}', 'Host': served.place}
    changed = {key.replace('_', '-'): value for key, value in changes.items()}
    return {key: value for key, value in {**own, **changed}.items() if value is not None}


@asynccontextmanager
async def opened(
    session: Session, served: Served, token: str | None = None
) -> AsyncIterator[Socket]:
    """Open the socket as the page does, the right token by default."""
    sent_token = served.guard.token if token is None else token
    async with session.ws_connect(
        f'http://{served.place}/socket?token={sent_token}', headers=headers(served), max_msg_size=0
    ) as socket:
        yield socket


async def frame(socket: Socket) -> dict[str, Any]:
    """Return the next frame, and say that it is drawn."""
    content: dict[str, Any] = json.loads((await socket.receive(PATIENCE)).data)
    await socket.send_json({'ack': content['n']})
    return content


async def answer_to(socket: Socket, command: dict[str, Any]) -> dict[str, Any]:
    await socket.send_json(command)
    while True:
        content = await frame(socket)
        for answer in content.get('answers', ()):
            if answer['id'] == command['id']:
                return dict(answer)


async def is_served(session: Session, served: Served) -> None:
    """Find that the honest page still can do all that it could."""
    async with opened(session, served) as socket:
        command_count = len(served.state.commands)
        assert (await answer_to(socket, TAKE))['done']
        assert len(served.state.commands) == command_count + 1


@pytest.mark.parametrize('name', REQUESTS['handshakes'])
@attacking
async def test_a_hostile_handshake_is_refused(served: Served, name: str, session: Session) -> None:
    port = str(served.guard.port)
    changes = {k: v and v.replace('PORT', port) for k, v in REQUESTS['handshakes'][name].items()}

    with pytest.raises(aiohttp.WSServerHandshakeError) as caught:
        await session.ws_connect(
            f'http://{served.place}/socket?token={served.guard.token}',
            headers=headers(served, **changes),
        )
    assert caught.value.status == 403


@pytest.mark.parametrize(
    'twice', [('Origin', 'http://evil.example'), ('Sec-Fetch-Site', 'cross-site')]
)
@attacking
async def test_duplicate_headers_are_refused(
    served: Served, twice: tuple[str, str], session: Session
) -> None:
    doubled = CIMultiDict({**headers(served), 'Sec-Fetch-Site': 'same-origin'})
    doubled.add(*twice)
    url = f'http://{served.place}/socket?token={served.guard.token}'
    with pytest.raises(aiohttp.WSServerHandshakeError) as caught:
        await session.ws_connect(url, headers=doubled)
    assert caught.value.status == 403


@attacking
async def test_no_more_pages_are_served_than_the_limit(
    monkeypatch: pytest.MonkeyPatch, session: Session
) -> None:
    monkeypatch.setattr('klann_ros.live.server.MAX_CLIENTS', 2)
    server = LiveServer(Guard('127.0.0.1', 0, 'secret'), FakeState())
    served = Served(FakeState(), server)

    async with opened(session, served) as first, opened(session, served):
        with pytest.raises(aiohttp.WSServerHandshakeError) as caught:
            await session.ws_connect(f'http://{served.place}/socket', headers=headers(served))
        assert caught.value.status == 503
        await frame(first)
    server.close()


@pytest.mark.parametrize('token', ['', 'wrong', 'A' * 32, '%00', '%ff', 'ö', 'x' * 5000])
@attacking
async def test_without_the_session_token_a_page_is_read_only(
    served: Served, token: str, session: Session
) -> None:
    async with opened(session, served, token) as socket:
        commands = list(served.state.commands)
        you = (await frame(socket))['client']
        assert not you['may_drive']
        assert not you['runs']
        for number, do in enumerate(('take', 'release'), start=1):
            answer = await answer_to(socket, {**TAKE, 'id': number, 'command': do})
            assert answer == {'id': number, 'done': False, 'message': 'this page may only view'}
        assert served.state.commands == commands


MESSAGES = {
    **REQUESTS['messages'],
    'deep': '[' * 2000,
    'a long integer': '{"id": 1, "command": "turn", "target": "", "value": ' + '9' * 3000 + '}',
    'a long name': '{"id": 1, "command": "take", "target": "' + 'x' * 1000 + '"}',
    'bytes': b'{}',
}


@pytest.mark.parametrize('name', MESSAGES)
@attacking
async def test_an_invalid_message_closes_only_its_socket(
    served: Served, name: str, session: Session
) -> None:
    async with opened(session, served) as honest, opened(session, served) as socket:
        await frame(honest)
        commands = list(served.state.commands)
        message = MESSAGES[name]
        await (socket.send_bytes if name == 'bytes' else socket.send_str)(message)
        while (await socket.receive(PATIENCE)).type == aiohttp.WSMsgType.TEXT:
            pass
        assert socket.close_code == aiohttp.WSCloseCode.POLICY_VIOLATION
        assert served.state.commands == commands
        assert (await answer_to(honest, TAKE))['done']


@attacking
async def test_a_frame_of_ten_megabytes_is_not_taken(served: Served, session: Session) -> None:
    async with opened(session, served) as honest, opened(session, served) as socket:
        await frame(honest)
        with pytest.raises((ConnectionError, aiohttp.ClientError)):
            for _ in range(100):
                await socket.send_str('x' * 10_000_000)
        assert (await answer_to(honest, TAKE))['done']


@attacking
async def test_a_page_may_send_more_than_a_frame_in_whole_messages(
    served: Served, session: Session
) -> None:
    async with opened(session, served) as socket:
        for _ in range(4 * MAX_UNREAD // MAX_MESSAGE_SIZE):
            await socket.send_str('{}'.ljust(MAX_MESSAGE_SIZE // 2))
        assert (await answer_to(socket, TAKE))['done']


@attacking
async def test_a_frame_that_never_ends_is_cut_off(served: Served, session: Session) -> None:
    async with opened(session, served) as honest:
        await frame(honest)
        reader, writer = await asyncio.open_connection('127.0.0.1', served.guard.port)
        writer.write(
            (
                f'GET /socket HTTP/1.1\r\nHost: {served.place}\r\n'
                f'Origin: http://{served.place}\r\n'
                'Upgrade: websocket\r\nConnection: Upgrade\r\n'
                'Sec-WebSocket-Version: 13\r\n'
                'Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n'
            ).encode()
        )
        await reader.readuntil(b'\r\n\r\n')
        # A text of 2^40 bytes, masked.
        writer.write(b'\x81\xff' + struct.pack('!Q', 2**40) + b'\0\0\0\0')
        with pytest.raises(ConnectionError):
            for _ in range(10_000):
                writer.write(b'x' * 10_000)
                await writer.drain()
        assert (await answer_to(honest, TAKE))['done']


@attacking
async def test_ten_thousand_messages_at_once_end_their_socket_only(
    served: Served, session: Session
) -> None:
    async with opened(session, served) as honest, opened(session, served) as socket:
        await frame(honest)
        served.state.commands.clear()
        with pytest.raises((ConnectionError, aiohttp.ClientError)):
            for number in range(1_000_000):
                await socket.send_json({**TAKE, 'id': number})
        assert (await answer_to(honest, {**TAKE, 'id': 7}))['done']
        assert len(served.state.commands) < 10_000


@pytest.mark.parametrize('path', REQUESTS['paths'])
@attacking
async def test_path_traversal_is_refused(served: Served, path: str, session: Session) -> None:
    reader, writer = await asyncio.open_connection('127.0.0.1', served.guard.port)
    request = f'GET {path}?token={served.guard.token} HTTP/1.1\r\nHost: {served.place}\r\n'
    writer.write(f'{request}Connection: close\r\n\r\n'.encode())
    answer = await reader.read()
    assert answer.split()[1] in {b'404', b'403', b'400'}
    assert b'nobody reads this' not in answer
    await is_served(session, served)


@pytest.mark.parametrize('method', ['POST', 'PUT', 'DELETE', 'OPTIONS', 'TRACE', 'PATCH'])
@attacking
async def test_nothing_is_changed_by_a_request(
    served: Served, method: str, session: Session
) -> None:
    for path in ('/', '/socket', '/runs/good', '/static/live.js'):
        url = f'http://{served.place}{path}?token={served.guard.token}'
        async with session.request(method, url, headers=headers(served)) as answer:
            assert answer.status in {403, 405}
            assert 'Access-Control-Allow-Origin' not in answer.headers


@attacking
async def test_every_answer_has_the_policy_and_no_page_may_hold_it(
    served: Served, session: Session
) -> None:
    for path in ('/', '/static/live.js', '/nowhere', '/socket'):
        async with session.get(f'http://{served.place}{path}') as answer:
            policy = answer.headers['Content-Security-Policy']
            assert "default-src 'none'" in policy
            assert 'unsafe' not in policy
            assert "frame-ancestors 'none'" in policy
            assert answer.headers['X-Content-Type-Options'] == 'nosniff'
            assert answer.headers['Cross-Origin-Resource-Policy'] == 'same-origin'
            assert answer.headers['Cache-Control'] == 'no-store'
    async with session.get(f'http://{served.place}/') as answer:
        text = await answer.text()
        assert served.guard.token not in text
        assert '<script>' not in text
        assert ' style=' not in text


@attacking
async def test_runs_require_the_session_token(served: Served, session: Session) -> None:
    for path in ('/runs', '/runs/good'):
        async with session.get(f'http://{served.place}{path}') as answer:
            assert answer.status == 403
    url = f'http://{served.place}/runs?token={served.guard.token}'
    async with session.get(url, headers={'Sec-Fetch-Site': 'cross-site'}) as answer:
        assert answer.status == 403
    async with session.get(url) as answer:
        text = await answer.text()
        assert '>good</a>' in text
        assert 'link' not in text.replace('<link', '')
        assert '<img' not in text


@attacking
async def test_a_page_that_reads_nothing_costs_nothing(served: Served, session: Session) -> None:
    state = served.state
    state.padding = 'x' * 50_000
    async with opened(session, served) as honest, opened(session, served) as stalled:
        seen = []
        for _ in range(60):
            seen.append((await frame(honest))['poses']['version'])
            state.changed()
            await asyncio.sleep(0.006)
        first = json.loads((await stalled.receive(PATIENCE)).data)
        await stalled.send_json({'ack': first['n']})
        second = json.loads((await stalled.receive(PATIENCE)).data)
        # What came in between was not kept for it; it gets the current state.
        assert (first['n'], second['n']) == (1, 2)
        assert second['poses']['version'] >= seen[-1]
        assert len(set(seen)) > 50
    state.padding = ''


@attacking
async def test_a_frame_that_was_not_sent_is_not_drawn(served: Served, session: Session) -> None:
    async with opened(session, served) as socket:
        first = json.loads((await socket.receive(PATIENCE)).data)
        for number in (0, first['n'] + 1, 10**6):
            await socket.send_json({'ack': number})
        served.state.changed()
        with pytest.raises(asyncio.TimeoutError):
            await socket.receive(0.3)


@attacking
async def test_the_state_is_notified_of_disconnected_pages(
    served: Served, session: Session
) -> None:
    async with opened(session, served) as socket:
        page = (await frame(socket))['client']['page']
    while page not in served.state.gone:
        await asyncio.sleep(0.01)


@attacking
async def test_malformed_requests_are_answered_400_and_logged_in_one_line(
    caplog: pytest.LogCaptureFixture,
) -> None:
    lines: list[str] = []
    server = LiveServer(Guard('127.0.0.1', 0, 'secret'), FakeState(), warn=lines.append)
    port = server.guard.port
    host = f'Host: 127.0.0.1:{port}\r\n'
    requests = {
        'a long URL': f'GET /{"x" * 9000} HTTP/1.1\r\n{host}',
        'two hosts': f'GET / HTTP/1.1\r\n{host}{host}',
        'no host': 'GET / HTTP/1.1\r\n',
        'a long header': f'GET / HTTP/1.1\r\n{host}X: {"x" * 9000}\r\n',
        'no HTTP': '\x16\x03\x01\x02',
        'no method': 'G\x01T / HTTP/1.1\r\n',
    }

    for name, request in requests.items():
        for _ in range(20):
            reader, writer = await asyncio.open_connection('127.0.0.1', port)
            writer.write(f'{request}\r\n\r\n'.encode('latin-1'))
            assert (await reader.readline()).split()[1] == b'400', name
            writer.close()
    server.close()
    # The first, and the rest at the end; more on a machine that takes 5 s for them.
    assert lines
    assert len(lines) < 10
    assert f'refused so far: {20 * len(requests)} (' in lines[-1]
    assert [record for record in caplog.records if record.exc_info] == []


def test_an_address_that_is_not_this_machines_is_refused_in_one_line() -> None:
    with pytest.raises(ServerError, match=r'^cannot listen on 203\.0\.113\.1, port 0: .+$'):
        LiveServer(Guard('203.0.113.1', 0, ''), FakeState())


@pytest.mark.filterwarnings('ignore:coroutine .* was never awaited')
def test_a_start_without_files_for_an_event_loop_is_refused_in_one_line(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def refuse() -> None:
        raise OSError(errno.EMFILE, os.strerror(errno.EMFILE))

    monkeypatch.setattr(asyncio.events, 'new_event_loop', refuse)
    with pytest.raises(ServerError, match=r'^cannot listen on .+: Too many open files$'):
        LiveServer(Guard('127.0.0.1', 0, ''), FakeState())
