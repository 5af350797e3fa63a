"""
Workers that share the tests: processes forked from the one that has collected them.

The workers of pytest-xdist import and collect everything again, which costs each of them ten
seconds of CPU.
"""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import Pipe
from multiprocessing.connection import Connection, wait
import os
import signal
import sys
import time
import traceback
from typing import Any
import warnings

import pytest

# Indices of tests that a worker runs in this order, with the fixtures of their file.
Batch = list[int]
# Timeout of a worker to close its fixtures [s].
GRACE = 6.0


@dataclass(eq=False)
class Worker:
    """A worker as its parent sees it: it is at a position of its batch."""

    number: int
    pid: int
    connection: Connection
    batch: Batch
    position: int = 0

    def end(self) -> None:
        """Interrupt its test, and wait until it has closed its fixtures."""
        self.connection.close()
        os.kill(self.pid, signal.SIGINT)
        deadline = time.monotonic() + GRACE
        while os.waitpid(self.pid, os.WNOHANG) == (0, 0):
            if time.monotonic() > deadline:
                os.kill(self.pid, signal.SIGKILL)
            time.sleep(0.02)


class Distribution:
    """Batches of tests and the workers that run them; `choose` selects a worker's next batch."""

    def __init__(
        self,
        session: pytest.Session,
        batches: list[Batch],
        choose: Callable[[list[Batch], int], Batch],
    ) -> None:
        self._session = session
        self._hook = session.config.hook
        self._batches = batches
        self._choose = choose
        self._workers: list[Worker] = []
        # Made before the first fork: workers have folders in it.
        self._folder = session.config._tmp_path_factory.getbasetemp()  # type: ignore[attr-defined]

    def run(self, worker_count: int) -> None:
        """Run all batches."""
        terminal: Any = self._session.config.pluginmanager.getplugin('terminalreporter')
        # Results of several files come at the same time.
        terminal.showfspath = False
        try:
            for number in range(worker_count):
                self._fork(number)
            while self._workers:
                for ready in wait([worker.connection for worker in self._workers]):
                    self._receive(ready)
                    self._stop_if_told()
        except KeyboardInterrupt:
            for nodeid in self._running_tests():
                terminal.write_line(f'\ninterrupted in {nodeid}')
            raise
        finally:
            for worker in self._workers:
                worker.end()

    def _stop_if_told(self) -> None:
        """Stop after the number of failed tests that the user has named."""
        if self._session.shouldfail:
            raise self._session.Failed(self._session.shouldfail)
        if self._session.shouldstop:
            raise self._session.Interrupted(self._session.shouldstop)

    def _running_tests(self) -> list[str]:
        tests = []
        for worker in self._workers:
            if worker.position < len(worker.batch):
                tests.append(self._session.items[worker.batch[worker.position]].nodeid)
        return tests

    def _fork(self, number: int) -> None:
        connection, worker_connection = Pipe()
        sys.stdout.flush()
        sys.stderr.flush()
        pid = os.fork()
        if pid:
            worker_connection.close()
            self._workers.append(Worker(number, pid, connection, []))
            return
        for open_connection in (connection, *(worker.connection for worker in self._workers)):
            open_connection.close()
        folder = self._folder / f'worker{number}_{os.getpid()}'
        folder.mkdir()
        run_worker(self._session, worker_connection, folder)

    def _receive(self, connection: Any) -> None:
        worker = next(w for w in self._workers if w.connection is connection)
        kind, content = 'end', None
        with suppress(EOFError, ConnectionError):
            kind, content = connection.recv()
        if kind == 'ready':
            self._send_batch(worker)
        elif kind == 'warning':
            self._hook.pytest_warning_recorded.call_historic(kwargs=content)
        elif kind == 'report':
            report = self._hook.pytest_report_from_serializable(
                config=self._session.config, data=content
            )
            self._hook.pytest_runtest_logreport(report=report)
        elif kind == 'finish':
            worker.position += 1
        else:
            self._replace(worker)

    def _send_batch(self, worker: Worker) -> None:
        """Send the next tests; without any the worker ends."""
        worker.batch = self._choose(self._batches, worker.number) if self._batches else []
        worker.position = 0
        if worker.batch:
            self._batches.remove(worker.batch)
        worker.connection.send(worker.batch)

    def _replace(self, worker: Worker) -> None:
        """Report the test in which a worker ended; a new worker takes the rest of the batch."""
        self._workers.remove(worker)
        worker.connection.close()
        _, status = os.waitpid(worker.pid, 0)
        if not worker.batch and not status:
            return
        position = worker.position
        tests = worker.batch[position:]
        test = self._session.items[(tests or worker.batch or [0])[0]]
        code = os.waitstatus_to_exitcode(status)
        report = pytest.TestReport(
            nodeid=test.nodeid,
            location=test.location,
            keywords={},
            outcome='failed',
            longrepr=f'the worker ended with exit code {code} in this test or behind the last one',
            when='call',
        )
        self._hook.pytest_runtest_logreport(report=report)
        if tests[1:]:
            self._batches.append(tests[1:])
        if self._batches:
            self._fork(worker.number)


class WorkerReporter:
    """A plugin of a worker that sends its parent what the terminal has to show."""

    def __init__(self, config: pytest.Config, connection: Connection) -> None:
        self._config = config
        self._connection = connection
        # At its registration a plugin receives the warnings of the parent too.
        self.sends_warnings = False

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        content = self._config.hook.pytest_report_to_serializable(
            config=self._config, report=report
        )
        self._connection.send(('report', content))

    def pytest_runtest_logfinish(self) -> None:
        self._connection.send(('finish', None))

    def pytest_warning_recorded(
        self, warning_message: Any, when: Any, nodeid: str, location: Any
    ) -> None:
        # Its source, such as a coroutine, cannot be sent.
        shown = warnings.WarningMessage(
            UserWarning(f'{warning_message.category.__name__}: {warning_message.message}'),
            UserWarning,
            warning_message.filename,
            warning_message.lineno,
        )
        content = {'warning_message': shown, 'when': when}
        if self.sends_warnings:
            self._connection.send(('warning', content | {'nodeid': nodeid, 'location': location}))


def run_worker(session: pytest.Session, connection: Connection, folder: Any) -> None:
    """Run batches in this process until there is no more; end the process."""
    config = session.config
    exit_code = 1
    try:
        config._tmp_path_factory._basetemp = folder  # type: ignore[attr-defined]
        plugins = config.pluginmanager
        plugins.unregister(name='terminalreporter')
        reporter = WorkerReporter(config, connection)
        plugins.register(reporter)
        reporter.sends_warnings = True
        # Output that is captured goes into a file, whose position forked processes share.
        capture: Any = plugins.getplugin('capturemanager')
        capture.stop_global_capturing()
        capture.start_global_capturing()
        try:
            _run_batches(session, connection)
        finally:
            signal.signal(signal.SIGINT, signal.SIG_IGN)
            session._setupstate.teardown_exact(None)
        exit_code = 0
    except (KeyboardInterrupt, BrokenPipeError):
        # The parent tells why it ends.
        pass
    except BaseException:
        # What stands above in this stack belongs to the parent.
        os.write(2, traceback.format_exc().encode())
    finally:
        os._exit(exit_code)


def _run_batches(session: pytest.Session, connection: Connection) -> None:
    while True:
        connection.send(('ready', None))
        batch = connection.recv()
        if not batch:
            return
        tests = [session.items[index] for index in batch]
        # What is shared by all files stays for the next batch.
        next_nodes = [*tests[1:], session]
        for test, next_node in zip(tests, next_nodes, strict=True):
            session.config.hook.pytest_runtest_protocol(item=test, nextitem=next_node)
