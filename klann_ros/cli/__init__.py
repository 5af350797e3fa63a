"""The command line of every program: arguments, output files, tables of spreadsheets."""

from typing import TYPE_CHECKING

from klann_ros.lazy_face import lazy_face

if TYPE_CHECKING:
    from .arguments import (
        ArgumentParser,
        check_installed,
        command_words,
        COUNT,
        NOT_READ,
        NOT_WRITTEN,
        number_type,
        OutputError,
        path,
        print_error,
        SECONDS,
        UsageError,
    )
    from .outputs import (
        check_new_folder,
        new_folder,
        Output,
        output_errors,
        output_files,
        save_all,
        save_folder,
        save_texts,
    )
    from .tables import decoded_text, harmless, plain, read_table, Table, TableRow, write_table
else:
    __getattr__, __dir__, __all__ = lazy_face(__name__, __file__)
