"""Names out of a stranger's log are shown as what they are, wherever a report goes."""

import csv
import html
from itertools import chain
import json
from pathlib import Path
import re

from fork_server import called
from fuzzing.hostile import EVIL, hostile_run
from fuzzing.laws import hold
from klann_ros.review.command import main
from klann_ros.sanitize.text import printable
import pytest
from review_findings import found


@pytest.fixture(scope='module')
def evil(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder, _ = hostile_run(tmp_path_factory.mktemp('runs'))
    return folder


def test_hostile_names_add_no_lines_to_a_report(evil: Path, capsys) -> None:
    assert main([str(evil), str(evil)]) == 1
    output, errors = capsys.readouterr()
    assert errors == ''
    hold(output, 'review')
    for name in ('/joint_states', EVIL, f'/lost{EVIL}', f'gone{EVIL}'):
        assert printable(name)[:200] in output


def test_the_colours_of_a_terminal_are_ours_only(evil: Path, capsys, monkeypatch) -> None:
    monkeypatch.setattr('klann_ros.review.command._wants_colour', lambda: True)
    assert main([str(evil)]) == 1
    output = capsys.readouterr().out
    assert '\x1b[1;31mERROR\x1b[0m' in output
    hold(output, 'review', colours=True)


def strings(content) -> list[str]:
    if isinstance(content, str):
        return [content]
    if isinstance(content, dict):
        content = [*content, *content.values()]
    if not isinstance(content, list):
        return []
    return [*chain(*map(strings, content))]


def test_a_page_shows_letters_only(evil: Path, tmp_path: Path, capsys) -> None:
    file = tmp_path / 'page.html'
    main([str(evil), str(evil), '--html', str(file)])
    capsys.readouterr()
    page = file.read_text(encoding='utf-8')
    data = json.loads(re.search(r'<script[^>]* id="data"[^>]*>(.*?)</script>', page, re.DOTALL)[1])
    visible = html.unescape(re.sub(r'<(script|style)\b.*?</\1>', '', page, flags=re.DOTALL))
    for text in (*visible.split('\n'), *strings(data)):
        assert text.isprintable()
    assert printable(EVIL)[:50] in visible
    # What leads to a leg has the name under which its scripts know it.
    legs = {html.unescape(title) for title in re.findall('data-leg="(.*?)"', page)} - {''}
    assert legs
    for run in data:
        legs -= {leg['title'] for leg in run['legs']}
    assert legs == set()


def test_machine_readable_output_has_unchanged_names(evil: Path, tmp_path: Path, capsys) -> None:
    file = tmp_path / 'run.json'
    main([str(evil), '--json', str(file)])
    capsys.readouterr()
    assert file.read_text().isascii()
    names = {topic['name'] for topic in json.loads(file.read_text())['topics']}
    assert {f'/x{EVIL}', f'/json{EVIL}'} <= names


@pytest.mark.parametrize('name', ['=1+1', '+1', '-1', '@x', '=cmd|" /C calc"!A0'])
def test_a_spreadsheet_computes_no_name(
    healthy, make_script, make_run, capsys, *, name: str
) -> None:
    healthy.others = [make_script().in_namespace(f'/{name}\nx')]
    run = make_run(healthy)
    file = run.with_suffix('.csv')
    main([str(run), '--csv', str(file)])
    capsys.readouterr()
    with file.open(newline='') as opened:
        legs = {row['leg'] for row in csv.DictReader(opened)}
    assert legs == {'', f"'{name}\\nx"}
    assert len(file.read_text().splitlines()) == 801


def test_a_definition_costs_no_more_than_its_bytes(healthy, make_run) -> None:
    # To parse these takes hours.
    comment = '#' + '[' * 200_000 + '\n'
    fields = ''.join(f'float64 x{n}\n' for n in range(20_000))
    for topic, text in (('poses', comment), ('feet', fields)):
        definition = getattr(healthy, topic).definition
        healthy.alter(topic, definition=f'{definition}\n{text}')
    (line,) = found(make_run(healthy))
    assert line == 'decode: 400 messages of /point_h cannot be decoded'


@pytest.mark.parametrize('tool', ['review', 'recover'])
def test_arguments_may_be_the_names_of_any_files(tool: str) -> None:
    name = EVIL.replace('\0', '')
    done = called(tool, name, name, name, f'--{name}')
    assert (done.returncode, done.stdout) == (2, '')
    hold(done.stderr, tool)
