"""The options --html and --open of review."""

from dataclasses import replace
import os
from pathlib import Path

from klann_ros.review.command import main
from klann_ros.review.page import save
from klann_ros.review.reviewing import review_run
import pytest


@pytest.fixture
def run(runs, tmp_path: Path) -> Path:
    return replace(runs['klann'], count=50).write(tmp_path / 'run')


def test_one_file_is_written(run: Path, tmp_path: Path) -> None:
    assert main([str(run), '--html', str(tmp_path / 'page.html')]) == 0
    written = (tmp_path / 'page.html').read_text(encoding='utf-8')
    assert written.startswith('<!doctype html>')
    assert 'The MIT License' in written
    assert sorted(path.name for path in tmp_path.iterdir()) == ['page.html', 'run']


def test_two_runs_are_in_one_page(run: Path, tmp_path: Path) -> None:
    assert main([str(run), str(run), '--html', str(tmp_path / 'page.html')]) == 0
    written = (tmp_path / 'page.html').read_text(encoding='utf-8')
    assert 'The two runs do not differ.' in written


def test_failed_comparisons_are_in_the_page(run: Path, runs, tmp_path: Path) -> None:
    bare = replace(runs['klann'], count=50, parameters=None).write(tmp_path / 'bare')
    main([str(run), str(bare), '--html', str(tmp_path / 'page.html')])
    written = (tmp_path / 'page.html').read_text(encoding='utf-8')
    assert 'The two runs do not differ, as far as they can be compared.' in written
    assert 'the second run does not contain its geometry' in written


def test_a_path_need_not_be_a_text(run: Path, tmp_path: Path) -> None:
    named = run.rename(tmp_path / os.fsdecode(b'run\xff'))
    with (tmp_path / 'page.html').open('wb') as file:
        save([review_run(named)], None, file)
    assert r'run\udcff' in (tmp_path / 'page.html').read_text(encoding='utf-8')


def test_the_page_is_opened_in_the_named_browser(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    opened: list[str] = []
    monkeypatch.setattr('webbrowser.open', lambda url: opened.append(url) or True)
    monkeypatch.setenv('BROWSER', 'any')
    monkeypatch.setenv('TMPDIR', str(tmp_path))
    monkeypatch.setattr('tempfile.tempdir', None)
    assert main([str(run), '--open']) == 0
    assert main([str(run), '--open', '--html', str(tmp_path / 'page.html')]) == 0
    first, second = opened
    assert first.startswith(tmp_path.as_uri())
    assert Path(first.removeprefix('file://')).read_text(encoding='utf-8').startswith('<!doctype')
    assert second == (tmp_path / 'page.html').as_uri()
    assert 'no browser' not in capsys.readouterr().err


def test_without_a_browser_one_line_gives_the_page_path(
    run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ('DISPLAY', 'WAYLAND_DISPLAY', 'BROWSER'):
        monkeypatch.delenv(name, raising=False)
    assert main([str(run), '--open', '--html', str(tmp_path / 'page.html')]) == 0
    error = f'review: no browser here; the page is {tmp_path / "page.html"}\n'
    assert capsys.readouterr().err == error
