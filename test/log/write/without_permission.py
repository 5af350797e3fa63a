"""
Record while permissions are taken away, as a user who is not root.

    python test/log/write/without_permission.py FOLDER

Prints as JSON the messages found and written, and the errors before and after the end.
"""

import json
import os
from pathlib import Path
import sys

from crank_runs import make_messages
from klann_ros.log.errors import RunIncompleteError
from klann_ros.log.reader import open_log
from klann_ros.log.write.durable_file import RunFaults
from klann_ros.log.write.writer import RunWriter


def main(folder):
    if os.geteuid() == 0:
        os.chown(folder, 65534, 65534)
        os.setuid(65534)
    errors = []
    writer = RunWriter(Path(folder, 'run'), faults=RunFaults(errors.append))
    for number, message in enumerate(make_messages(40)):
        if number == 10:
            writer.file.path.chmod(0)
        elif number == 20:
            writer.path.chmod(0)
        elif number == 30:
            Path(folder).chmod(0)
        writer.write(message)
        writer.flush()
    before = list(errors)
    try:
        writer.close()
    except RunIncompleteError as error:
        errors.append(str(error))
    for path in (Path(folder), writer.path, writer.file.path):
        path.chmod(0o700)
    with open_log(writer.path) as log:
        found = len(list(log.messages()))
    print(json.dumps([found, writer.stored_counts().written.total(), before, errors]))


main(*sys.argv[1:])
