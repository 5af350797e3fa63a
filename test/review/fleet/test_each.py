"""Many runs, each judged alone: a bad one is a row with its reason, and never stops the rest."""

from collections.abc import Callable
import json
import os
from pathlib import Path
import resource
import shutil
import signal
import subprocess
import sys
import time
from typing import Any
import xml.etree.ElementTree as ET

from browser_page import OpenedPage
from klann_ros.kinematics import KlannLeg
from klann_ros.log.reader import open_log
from klann_ros.review.fleet import (
    expectations_from_file,
    ExpectationsFileError,
    find_runs,
    FoundRun,
    judge,
    judge_runs,
    Row,
    Task,
)
import klann_ros.review.fleet.command as each_command
from klann_ros.review.fleet.rows import rows_from_table
from leg_runs import LegRun
import pytest
import yaml
from yaml_tables import read_table

# The runs that are judged at an interrupt.
MANY = 10
GEOMETRY = {**KlannLeg().linkage.dimensions, 'assembly': [1, 1]}
TABLES = read_table(Path(__file__).with_name('tables.yaml'))
# In the order of their names.
VERDICTS = {
    '<img onerror=x>': 'findings',
    'cut': 'findings',
    'good': 'ok',
    'empty.mcap': 'unreadable',
    'loop': 'unreadable',
    'pipe.mcap': 'unreadable',
    'wrong': 'findings',
}


@pytest.fixture(scope='module')
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder of runs, each with a fault of its own."""
    root = tmp_path_factory.mktemp('runs')
    LegRun(parameters=GEOMETRY).write(root / 'good')
    LegRun(parameters={**GEOMETRY, 'l_ab': 0.121}).write(root / 'wrong')
    LegRun(parameters=GEOMETRY, pause=(200, 1.5)).write(root / '<img onerror=x>')
    shutil.copytree(root / 'good', root / 'cut')
    (log,) = (root / 'cut').glob('*.mcap')
    os.truncate(log, log.stat().st_size // 2)
    inner = root / 'inner'
    inner.mkdir()
    (inner / 'loop').symlink_to(root)
    os.mkfifo(inner / 'pipe.mcap')
    (inner / 'empty.mcap').touch()
    return root


def review(*arguments: object, **options: Any) -> subprocess.Popen[str]:
    """Start the command as a process."""
    code = 'import sys; from klann_ros.executables import review; sys.exit(review())'
    command = [sys.executable, '-c', code, '--each', *map(str, arguments)]
    pipes = {'stdout': subprocess.PIPE, 'stderr': subprocess.PIPE, 'text': True}
    return subprocess.Popen(command, **{**pipes, **options})


@pytest.fixture(scope='module')
def outputs(runs: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of all outputs."""
    out = tmp_path_factory.mktemp('out')
    options = [f'--{kind}={out / name}' for kind, name in _OUTPUTS.items()]
    process = review(runs, *options, '--annotate', out / 'copies', '--jobs', '2')
    report, errors = process.communicate(timeout=120.0)
    assert (process.returncode, errors) == (2, '')
    assert report.startswith('7 runs of 7: 1 ok, 3 with findings, 3 unreadable\n')
    return out


_OUTPUTS = {'table': 'table.csv', 'junit': 'junit.xml', 'html': 'index.html'}


def test_each_run_is_a_row_with_its_reason(outputs: Path) -> None:
    rows = rows_from_table(str(outputs / 'table.csv'))
    assert {Path(row.run).name: row.verdict for row in rows} == VERDICTS
    reasons = {Path(row.run).name: row.reason for row in rows}
    assert reasons['good'] == ''
    assert 'named pipe' in reasons['pipe.mcap']
    assert 'leads back' in reasons['loop']
    assert reasons['wrong'].startswith('closure: 400 of 400 poses')
    wrong = rows[[*VERDICTS].index('wrong')]
    assert json.loads(wrong.findings)[0]['check'] == 'closure'
    assert wrong.worst_residual == pytest.approx(1e-3, rel=1e-6)


def test_the_figures_of_a_row_are_those_of_what_is_known(healthy: Any, make_run: Any) -> None:
    # Commands have no rate, and a topic without sequence numbers no known loss.
    healthy.stream('/cmd_vel', 'geometry_msgs/msg/Twist', [0, 200], [1800, 2000])
    healthy.unnumber()
    row = judge(Task(FoundRun(str(make_run(healthy))))).row
    assert row.longest_gap == pytest.approx(0.005)
    assert row.lost == 0
    healthy.messages.clear()
    assert judge(Task(FoundRun(str(make_run(healthy, 'unnumbered'))))).row.lost is None


def test_a_folder_that_cannot_be_searched_is_a_row(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ('died', 'runs/inner', 'other'):
        (tmp_path / name).mkdir(parents=True)
    (tmp_path / 'other/x.mcap').touch()
    (tmp_path / 'runs/inner/again').symlink_to(tmp_path / 'other')
    (tmp_path / 'searched').mkdir()
    (tmp_path / 'searched/link').symlink_to(tmp_path / 'runs')
    (tmp_path / 'searched/died').mkdir()
    (tmp_path / 'searched/locked').symlink_to(tmp_path / 'secret')
    stat = Path.stat

    def refused(path: Path, **options: bool) -> os.stat_result:
        if path.name == 'locked' and options.get('follow_symlinks', True):
            raise PermissionError(13, 'Permission denied')
        return stat(path, **options)

    # The tests may run as root, who is refused nothing.
    monkeypatch.setattr(Path, 'stat', refused)
    faults = {Path(run.path).name: run.fault for run in find_runs([str(tmp_path / 'searched')])}
    assert faults.keys() == {'again', 'died', 'locked'}
    assert 'not followed' in faults['again']
    assert 'no log in it' in faults['died']
    assert 'Permission denied' in faults['locked']


def test_rows_are_the_same_byte_for_byte_however_many_make_them(
    runs: Path, outputs: Path, tmp_path: Path
) -> None:
    table = tmp_path / 'table.csv'
    assert each_command.main(['--each', str(runs), '--table', str(table), '--jobs', '1']) == 2
    assert table.read_bytes() == (outputs / 'table.csv').read_bytes()


@pytest.mark.slow
def test_a_parquet_table_is_the_csv(outputs: Path, tmp_path: Path) -> None:
    pandas = pytest.importorskip('pandas')
    rows = rows_from_table(str(outputs / 'table.csv'))
    path = tmp_path / 'table.parquet'
    each_command.check_table(str(path))
    with path.open('wb') as file:
        each_command.save_table(str(path), rows, file)
    assert rows_from_table(str(path)) == rows
    frame = pandas.read_parquet(path)
    assert frame['run'].tolist() == [row.run for row in rows]


@pytest.mark.slow
def test_duckdb_queries_a_parquet_table(outputs: Path, tmp_path: Path) -> None:
    duckdb = pytest.importorskip('duckdb')
    path = tmp_path / 'table.parquet'
    with path.open('wb') as file:
        each_command.save_table(str(path), rows_from_table(str(outputs / 'table.csv')), file)
    query = f"select verdict, count(*) from '{path}' group by 1 order by 1"  # noqa: S608
    assert duckdb.sql(query).fetchall() == [('findings', 3), ('ok', 1), ('unreadable', 3)]


def test_the_junit_file_is_read_by_a_public_parser(outputs: Path) -> None:
    junitparser = pytest.importorskip('junitparser')
    (suite,) = junitparser.JUnitXml.fromfile(str(outputs / 'junit.xml'))
    assert (suite.tests, suite.failures, suite.errors) == (7, 3, 3)
    verdicts = {'': 'ok', 'Failure': 'findings', 'Error': 'unreadable'}
    junit_verdicts = {}
    for case in suite:
        junit_verdicts[case.name] = verdicts[
            ''.join(type(outcome).__name__ for outcome in case.result)
        ]
    assert junit_verdicts == VERDICTS


def test_the_index_leads_to_the_page_of_each_run(outputs: Path) -> None:
    text = (outputs / 'index.html').read_text()
    assert '<img onerror' not in text
    links = [part.partition('"')[0] for part in text.split('href="')[1:]]
    assert len(links) == 4
    for link in links:
        assert '<title>Review of' in (outputs / link).read_text()


def test_the_index_is_sorted_and_filtered_and_fits_a_phone(
    outputs: Path, new_page: Callable[..., Any]
) -> None:
    pytest.importorskip('playwright')
    opened = OpenedPage(new_page(), (outputs / 'index.html').as_uri())
    page = opened.page

    def shown_runs() -> list[str]:
        return page.locator('tbody tr:visible th').all_inner_texts()

    assert shown_runs()[:3] == ['inner/empty.mcap', 'inner/loop', 'inner/pipe.mcap']
    by_duration = page.locator('thead button', has_text='Duration')
    by_duration.click()
    # Unknown ones are last in both directions.
    assert shown_runs()[0] == 'cut'
    by_duration.click()
    assert shown_runs()[0] == '<img onerror=x>'
    assert shown_runs()[-1].startswith('inner/')
    page.locator('[data-filter=checks]').select_option('closure')
    assert shown_runs() == ['wrong']
    assert page.locator('[role=status]').inner_text() == '1 of 7 runs shown'
    page.locator('[data-filter=checks]').select_option('')
    page.locator('[data-filter=text]').fill('NAMED pipe')
    assert shown_runs() == ['inner/pipe.mcap']
    page.locator('[data-filter=text]').fill('')
    page.locator('[data-filter=verdict]').select_option('nothing found')
    assert shown_runs() == ['good']
    page.set_viewport_size({'width': 360, 'height': 740})
    page.locator('[data-filter=verdict]').select_option('')
    assert not opened.is_too_wide()
    scrolling = page.locator('.scrolls')
    assert scrolling.evaluate('(region) => region.scrollWidth <= region.clientWidth')
    assert opened.complaints == []
    assert opened.barriers() == []


def test_each_readable_run_has_an_annotated_copy(runs: Path, outputs: Path) -> None:
    copies = {path.name.partition('_')[2]: path for path in (outputs / 'copies').iterdir()}
    assert copies.keys() == {'_img_onerror_x_', 'cut', 'good', 'wrong'}
    with open_log(runs / 'wrong') as log, open_log(copies['wrong']) as copy:
        names = {topic.name for topic in log.topics}
        data = sorted(message.data for message in log.messages())
        assert sorted(message.data for message in copy.messages(names)) == data
        assert {topic.name for topic in copy.topics} > names


def test_ctrl_c_leaves_a_table_and_resume_continues(runs: Path, tmp_path: Path) -> None:
    many = tmp_path / 'many'
    many.mkdir()
    for number in range(MANY):
        (many / f'run{number}').symlink_to(runs / 'good')
    # Each once: the same run under many names is one.
    assert len(find_runs([str(many)])) == 1
    for number in range(MANY):
        (many / f'run{number}').unlink()
        shutil.copytree(runs / 'good', many / f'run{number}')
    table = tmp_path / 'table.csv'
    process = review(many, '--table', table, '--html', tmp_path / 'index.html', '--jobs', '1')
    pages = tmp_path / 'index_runs'
    while not (pages.exists() and len(list(pages.glob('*.html'))) > 3):
        time.sleep(0.02)
        assert process.poll() is None
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60.0)
    assert process.returncode == 130
    assert '--resume goes on' in errors
    assert 'Traceback' not in errors
    done = rows_from_table(str(table))
    assert 1 <= len(done) < MANY
    page_time = (pages / '01_run0.html').stat().st_mtime_ns
    # The table is read whole, in less memory than its largest size.
    again = review(
        *(many, '--table', table, '--html', tmp_path / 'index.html', '--resume'),
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (8_000_000_000,) * 2),
    )
    again.communicate(timeout=120.0)
    assert again.returncode == 0
    assert len(rows_from_table(str(table))) == MANY
    assert (pages / '01_run0.html').stat().st_mtime_ns == page_time


def expectations(folder: Path, text: str) -> Any:
    file = folder / 'expect.yaml'
    file.write_text(text)
    return expectations_from_file(str(file))


@pytest.mark.parametrize('case', TABLES['met'], ids=lambda case: str(case['expect']))
def test_a_run_is_held_against_the_expectations(
    case: dict[str, Any], runs: Path, tmp_path: Path
) -> None:
    (run,) = find_runs([str(runs / case['run'])])
    text = yaml.safe_dump(case['expect']).replace('RUNS', str(runs))
    row = judge(Task(run, expectations=expectations(tmp_path, text))).row
    checks = [finding['check'] for finding in json.loads(row.findings)]
    assert (row.verdict, checks) == (case['row']['verdict'], case['row']['checks'])
    assert row.allowed == len(case['expect'].get('allow', ()))
    assert case['row']['reason'] in row.reason


@pytest.mark.parametrize(('text', 'reason'), TABLES['refused'])
def test_invalid_expectations_are_refused_in_one_line(
    text: str, reason: str, tmp_path: Path
) -> None:
    with pytest.raises(ExpectationsFileError, match=reason):
        expectations(tmp_path, text)


def test_rows_come_in_the_order_of_the_tasks(runs: Path) -> None:
    tasks = [*map(Task, find_runs([str(runs / 'wrong'), str(runs / 'good')]))]
    rows = judge_runs(tasks, jobs=2)
    assert [Path(row.run).name for row in rows] == ['wrong', 'good']


@pytest.mark.parametrize(('arguments', 'code', 'reason'), TABLES['options'])
def test_impossible_options_are_refused_before_any_work(
    arguments: str, code: int, reason: str, runs: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    try:
        words = arguments.replace('A_FILE', __file__).split()
        exit_code = each_command.main(['--each', str(runs), *words])
    except SystemExit as end:
        exit_code = end.code
    assert exit_code == code
    assert reason in capsys.readouterr().err.splitlines()[-1]


def test_no_output_goes_into_a_run_or_a_file(
    runs: Path, outputs: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert each_command.main(['--each', str(runs), '--annotate', str(outputs / 'copies')]) == 3
    assert 'exists already' in capsys.readouterr().err
    assert (
        each_command.main(['--each', str(runs), '--table', str(runs / 'good' / 'table.csv')]) == 3
    )
    assert 'only read' in capsys.readouterr().err
    resumed = ['--resume', '--table', str(runs.with_name('table.csv')), '--annotate', __file__]
    assert each_command.main(['--each', str(runs), *resumed]) == 3
    assert capsys.readouterr().err.endswith(f'{__file__} cannot be made: it is no folder\n')


def test_a_folder_without_runs_is_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert each_command.main(['--each', str(tmp_path)]) == 2
    assert 'there is no run in' in capsys.readouterr().err


def test_untrusted_text_is_never_a_spreadsheet_formula(tmp_path: Path) -> None:
    row = Row('=cmd()', 'unreadable', '@x')
    path = tmp_path / 'table.csv'
    with path.open('wb') as file:
        each_command.save_table(str(path), [row], file)
    assert "\n'=cmd(),unreadable,'@x," in path.read_text()
    assert rows_from_table(str(path)) == [row]


def test_logs_beside_each_other_are_runs_of_their_own_unless_numbered(tmp_path: Path) -> None:
    for name in ('a/x_0.mcap', 'a/x_1.mcap', 'b/x_0.mcap', 'b/y_0.mcap', 'c/deep/run10/r.mcap'):
        file = tmp_path / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.touch()
    (tmp_path / 'c/deep/run2').mkdir()
    (tmp_path / 'c/deep/run2/metadata.yaml').touch()
    # An annotated copy whose review was killed.
    (tmp_path / '.klann-0a.new/copy').mkdir(parents=True)
    (tmp_path / '.klann-0a.new/copy/metadata.yaml').touch()
    paths = [Path(run.path).relative_to(tmp_path) for run in find_runs([str(tmp_path)])]
    expected = ['a', 'b/x_0.mcap', 'b/y_0.mcap', 'c/deep/run2', 'c/deep/run10/r.mcap']
    assert [*map(str, paths)] == expected


def test_a_page_of_junit_holds_no_letter_that_xml_forbids(tmp_path: Path) -> None:
    path = tmp_path / 'junit.xml'
    with path.open('wb') as file:
        each_command.save_junit([Row('runs/\x00\x1b[31m\ufffe', 'unreadable', 'a\x08b')], file)
    assert ET.parse(path).find('.//error') is not None  # noqa: S314 - it is ours
