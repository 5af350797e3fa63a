"""
Record while permissions are taken away, as a user who is not root.

    python test/log/write/without_permission.py FOLDER

Prints as JSON what was told, and what became of the messages.
"""

import json
import os
from pathlib import Path
import sys

from crank_runs import make_messages
from klann_ros.log.errors import RunHarmedError
from klann_ros.log.reader import open_log
from klann_ros.log.write.file_watch import Faults
from klann_ros.log.write.writer import RunWriter


def main(folder):
    if os.geteuid() == 0:
        os.chown(folder, 65534, 65534)
        os.setuid(65534)
    told = []
    writer = RunWriter(Path(folder, 'run'), faults=Faults(told.append, told.append))
    for number, message in enumerate(make_messages(40)):
        if number == 10:
            writer.file_path.chmod(0)
        elif number == 20:
            writer.path.chmod(0)
        elif number == 30:
            Path(folder).chmod(0)
        writer.write(message)
        writer.flush()
    before = list(told)
    try:
        writer.close()
    except RunHarmedError as error:
        told.append(str(error))
    for path in (Path(folder), writer.path, writer.file_path):
        path.chmod(0o700)
    with open_log(writer.path) as log:
        found = len(list(log.messages()))
    print(json.dumps([found, writer.fate().written.total(), before, told]))


main(*sys.argv[1:])
