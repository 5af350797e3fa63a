"""Runs are listed, and reviewed when asked for, beside the live page and never before it."""

import asyncio
from collections.abc import Awaitable, Callable
from html import unescape
import os
from pathlib import Path
import re
import sys

import aiohttp
from coroutine_thread import run_alone
from fake_live_state import EVIL, FakeState
from klann_ros.kinematics import KlannLeg
from klann_ros.live.guard import Guard
from klann_ros.live.live_page import list_page
from klann_ros.live.runs import Page, Reviews, runs_in
from klann_ros.live.server import LiveServer
from leg_runs import LegRun
from measured_robots import crank_topic, points_topic, Robot, write_run
import pytest

# What stands for `review`: it takes RUN --html FILE.
MADE_UP = """
import sys, time
_, run, option, file = sys.argv
assert option == '--html'
if 'bad' in run:
    sys.exit('this is no log')
open(file, 'w').write('review of ' + run)
"""
COMMAND = (sys.executable, '-c', MADE_UP)


def with_reviews(folder: Path, test: Callable[[Reviews], Awaitable[None]], *command: str) -> None:
    async def alone() -> None:
        reviews = Reviews(str(folder), command)
        try:
            await asyncio.wait_for(test(reviews), 120.0)
        finally:
            reviews.close()

    run_alone(alone())


async def made(reviews: Reviews, name: str) -> Page:
    page = await reviews.page(name)
    assert page is not None
    await page.done.wait()
    return page


def test_runs_are_listed_from_the_folder_itself(runs: Path) -> None:
    assert {run.name for run in runs_in(runs)} == {'good', EVIL.replace('/', '')}
    assert runs_in('/nowhere') == []


def test_an_empty_list_explains_how_to_record() -> None:
    assert 'Keep this moment' in list_page([], {}, 'token')


def test_the_newest_is_first(tmp_path: Path) -> None:
    for name in ('b', 'a'):
        (tmp_path / f'{name}.mcap').touch()
    first, second = runs_in(tmp_path)
    assert first.time >= second.time


@pytest.mark.parametrize('name', ['', '.', '..', '../secret.txt', 'link.mcap', 'nothing', '\0'])
def test_names_outside_the_list_have_no_review(runs: Path, name: str) -> None:
    async def look(reviews: Reviews) -> None:
        assert await reviews.page(name) is None

    with_reviews(runs, look, *COMMAND)


def test_a_review_is_made_once(runs: Path) -> None:
    async def look(reviews: Reviews) -> None:
        first = await made(reviews, 'good')
        assert first.failure == ''
        assert first.file.read_text() == f'review of {runs.absolute() / "good"}'
        assert await reviews.page('good') is first

    with_reviews(runs, look, *COMMAND)


def test_a_failed_review_shows_the_reason(tmp_path: Path) -> None:
    (tmp_path / 'bad.mcap').touch()

    async def look(reviews: Reviews) -> None:
        assert (await made(reviews, 'bad.mcap')).failure == 'this is no log'

    with_reviews(tmp_path, look, *COMMAND)

    async def stop(reviews: Reviews) -> None:
        assert 'cannot be made' in (await made(reviews, 'bad.mcap')).failure

    with_reviews(tmp_path, stop, '/nowhere/review')


def answers_of(folder: Path, address: str) -> list[tuple[aiohttp.ClientResponse, str]]:
    """Return all answers of a real server until the page is complete, with their texts."""
    server = LiveServer(Guard('127.0.0.1', 0, 'secret'), FakeState(), str(folder))
    answers: list[tuple[aiohttp.ClientResponse, str]] = []

    async def look() -> None:
        url = f'http://127.0.0.1:{server.guard.port}/runs{address}?token=secret'
        async with aiohttp.ClientSession() as session:
            while not answers or 'Refresh' in answers[-1][0].headers:
                async with session.get(url) as answer:
                    answers.append((answer, await answer.text()))
                await asyncio.sleep(0.02)

    run_alone(asyncio.wait_for(look(), 120.0))
    server.close()
    return answers


@pytest.mark.slow
def test_a_real_run_is_reviewed_by_a_real_process(tmp_path: Path) -> None:
    """The review's scripts get an origin of their own, not the server's."""
    LegRun().write(tmp_path / 'run')
    *_, (answer, text) = answers_of(tmp_path, '/run')
    assert answer.status == 200
    assert '<title>Review of run</title>' in text
    policy = answer.headers['Content-Security-Policy']
    assert policy == "sandbox allow-scripts; frame-ancestors 'none'"


def test_the_list_shows_verdicts_and_lengths(tmp_path: Path) -> None:
    parameters = KlannLeg().geometry.as_dict()
    LegRun(parameters=parameters).write(tmp_path / 'good')
    LegRun(parameters=parameters, pause=(200, 1.5)).write(tmp_path / 'gap')
    (tmp_path / 'empty.mcap').touch()
    for path in tmp_path.iterdir():
        os.utime(path, (1.7e9, 1.7e9))
    first, *_, (last, text) = answers_of(tmp_path, '')
    assert first[1].count('>in review<') == 3
    assert 'Refresh' not in last.headers
    rows = []
    for row in text.replace('<wbr>', '').split('<tr>')[2:]:
        rows.append(unescape(re.sub(r'<[^>]*>', ' ', row)))
    words = {row.split()[0]: row for row in rows}
    assert 'not readable' in words['empty.mcap']
    assert 'the file is empty' in words['empty.mcap']
    assert re.search(r'findings +gap: .* 3\.5 ', words['gap'])
    assert re.search(r'nothing found +2\.0 ', words['good'])


def test_a_run_that_still_changes_is_not_judged_yet(tmp_path: Path) -> None:
    (tmp_path / 'new.mcap').touch()

    async def look(reviews: Reviews) -> None:
        runs = await reviews.runs()
        assert reviews.judged_rows(runs) == {}
        assert '>changing<' in list_page(runs, {}, 'token')

    with_reviews(tmp_path, look, '/nowhere/review')


def test_a_run_without_a_row_is_not_judged_again_and_again(tmp_path: Path) -> None:
    (tmp_path / 'old.mcap').touch()
    os.utime(tmp_path / 'old.mcap', (0, 0))

    async def look(reviews: Reviews) -> None:
        runs = await reviews.runs()
        while not (rows := reviews.judged_rows(runs)):
            await asyncio.sleep(0.01)
        assert rows == {'old.mcap': None}
        assert '>not checked<' in list_page(runs, rows, 'token')

    with_reviews(tmp_path, look, '/nowhere/review')


def test_a_run_without_a_leg_is_not_calibrated(tmp_path: Path) -> None:
    LegRun().write(tmp_path / 'run')
    answers = answers_of(tmp_path, '/run/calibrate')
    answer, text = answers[-1]
    assert answer.status == 500
    assert 'the run does not contain the leg as drawn' in text
    assert all('<h1>Calibration</h1>' in page for _, page in answers)


@pytest.mark.slow
def test_a_run_with_measured_points_is_calibrated(tmp_path: Path) -> None:
    robot = Robot(count=300, period=0.0167)
    points = {f'/camera/{name}': points_topic(robot, name.upper()) for name in 'hg'}
    write_run(tmp_path / 'run', {'/crank_state': crank_topic(robot), **points}, {'l_ab': 0.12})

    async def look(reviews: Reviews) -> None:
        page = await reviews.page('run', 'calibrate')
        assert page is not None
        await page.done.wait()
        assert page.failure == ''
        text = page.file.read_text()
        assert 'All 14 parameters can be told apart' in text
        # The leg file, to be copied.
        assert 'ros__parameters:' in text

    with_reviews(tmp_path, look)
    assert '/runs/run/calibrate?token=secret' in list_page(runs_in(tmp_path), {}, 'secret')
