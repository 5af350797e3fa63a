"""Run programs of klann_ros one after the other, on a console with 256 letters; see the test."""

import io
import json
import os
from pathlib import Path
import sys


def console(errors: str) -> io.TextIOWrapper:
    """Return a stream as Python opens a redirected one on Windows."""
    return io.TextIOWrapper(io.BytesIO(), 'cp1252', errors, '\r\n', write_through=True)


def lab() -> int:
    """Return 0 if the lab is as it is stored."""
    from klann_ros.exercises.lab import lab_data, LAB_FILE, lab_page

    return int(lab_page(lab_data()) != LAB_FILE.read_text(encoding='utf-8'))


def dying_worker() -> int:
    """Print the answers of workers, one of which ends."""
    from klann_ros.engines import parallel_map

    print(*parallel_map(os._exit, [3], jobs=1))
    print(sorted(parallel_map(abs, [-1, -2, -3])))
    return 0


def main() -> None:
    """Run the programs of a file; write what they returned and printed to another one."""
    from klann_ros import executables

    commands, results = map(Path, sys.argv[1:])
    programs = {'lab': lab, 'dying_worker': dying_worker}
    outcomes = []
    for program, *arguments in json.loads(commands.read_text(encoding='utf-8')):
        sys.argv = [program, *arguments]
        sys.stdout = console('strict')
        sys.stderr = console('backslashreplace')
        try:
            code = (programs.get(program) or getattr(executables, program))()
        except BaseException:
            import traceback

            traceback.print_exc()
            code = -1
        texts = []
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
            texts.append(stream.buffer.getvalue().decode('cp1252'))
        outcomes.append([code, *texts])
    results.write_text(json.dumps(outcomes), encoding='utf-8')


if __name__ == '__main__':
    main()
