"""
Open an SQLite file of a stranger's, for reading what stands in its tables and nothing else.

What a schema may bring along is not used: views, triggers, indexes and functions are refused
when a statement is prepared, before anything of it runs (https://www.sqlite.org/security.html).
The file is opened immutable, so that nothing is made beside it and no lock is waited for.
"""

from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
import sqlite3

from klann_ros.sanitize.text import printable

TABLES = ('topics', 'messages', 'message_definitions', 'metadata')
"""What is read of a bag."""

_MASTER = 'sqlite_master'
_READABLE = frozenset((*TABLES, _MASTER, 'sqlite_schema'))
_FUNCTIONS = frozenset(('count', 'length', 'max', 'min', 'sum', 'typeof'))
_SETTINGS = (
    'PRAGMA trusted_schema = OFF',
    'PRAGMA query_only = ON',
    'PRAGMA cell_size_check = ON',
    'PRAGMA mmap_size = 0',
    'PRAGMA temp_store = MEMORY',
)


class DatabaseError(Exception):
    """SQLite cannot read the file, or its rows are inconsistent; the text says why."""


@contextmanager
def database(path: Path) -> Iterator[sqlite3.Connection]:
    """
    Open an SQLite file without the journal beside it; texts are returned as bytes.

    Raises
    ------
    DatabaseError
        It cannot be opened, or SQLite refuses it while it is open.

    """
    uri = f'{path.absolute().as_uri()}?mode=ro&immutable=1'
    try:
        with closing(sqlite3.connect(uri, uri=True, isolation_level=None)) as connection:
            connection.text_factory = bytes
            for setting in _SETTINGS:
                connection.execute(setting).close()
            connection.set_authorizer(_authorize)
            yield connection
    except (sqlite3.Error, UnicodeDecodeError) as error:
        raise DatabaseError(reason_of(error)) from None


def reason_of(error: Exception) -> str:
    """Return why SQLite failed; its own message may quote names that are no UTF-8."""
    if isinstance(error, UnicodeDecodeError):
        return 'its schema is damaged: a name in it is no UTF-8 text'
    return printable(error)


def columns(connection: sqlite3.Connection, table: str) -> frozenset[str]:
    """Return the columns of one of TABLES; none if there is no such table with numbered rows."""
    own = f"type = 'table' AND name = '{table}'"
    query = f'SELECT rootpage FROM {_MASTER} WHERE {own}'  # noqa: S608 - one of TABLES
    root = connection.execute(query).fetchone()
    # Virtual tables have no page of their own.
    if root is None or not root[0]:
        return frozenset()
    rows = connection.execute(f'PRAGMA table_xinfo({table})').fetchall()
    numbered = any(row[1:3] == (b'id', b'INTEGER') and row[5] == 1 for row in rows)
    # Hidden ones are computed when they are read.
    plain = frozenset(text(row[1]) for row in rows if not row[6])
    return plain if numbered and 'id' in plain else frozenset()


def table_names(connection: sqlite3.Connection) -> list[str]:
    """Return the names of the first tables."""
    query = f"SELECT name FROM {_MASTER} WHERE type = 'table' LIMIT 5"  # noqa: S608
    return [text(name) for (name,) in connection.execute(query)]


def text(value: object) -> str:
    """Return what stands in a table as a text, whatever it is."""
    return value.decode(errors='replace') if isinstance(value, bytes) else str(value)


def _authorize(
    action: int, first: str | None, second: str | None, _: str | None, source: str | None
) -> int:
    """Allow what is named here, and only directly: not out of a view or a trigger."""
    allowed = {
        sqlite3.SQLITE_SELECT: True,
        sqlite3.SQLITE_READ: first in _READABLE,
        sqlite3.SQLITE_FUNCTION: second in _FUNCTIONS,
        sqlite3.SQLITE_PRAGMA: first == 'table_xinfo',
    }
    if source is None and allowed.get(action, False):
        return sqlite3.SQLITE_OK
    return sqlite3.SQLITE_DENY
