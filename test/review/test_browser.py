"""A review where Python has neither locks, limits of processes nor compression: in a browser."""

import json
import os
from pathlib import Path
import subprocess
import sys

from klann_ros.review.reviewing import review_run
from leg_runs import LegRun

REVIEW = """
import json, sys
sys.modules.update(dict.fromkeys(('fcntl', 'resource', 'lz4', 'zstandard')))
from klann_ros.review import review_run
reviews = map(review_run, sys.argv[1:])
print(json.dumps([[[t.count for t in r.topics], [f.text for f in r.findings]] for r in reviews]))
"""


def test_uncompressed_runs_are_reviewed_and_compressed_chunks_reported(tmp_path: Path) -> None:
    runs = [LegRun().write(tmp_path / kind, kind) for kind in ('none', 'lz4', 'zstd')]
    done = subprocess.run(
        [sys.executable, '-c', REVIEW, *runs],
        capture_output=True,
        check=True,
        env={**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)},
    )
    (counts, findings), (_, of_lz4), (_, of_zstd) = json.loads(done.stdout)
    review = review_run(runs[0])
    assert counts == [topic.count for topic in review.topics]
    assert findings == [finding.text for finding in review.findings]
    assert "the compression 'lz4' is not known" in ''.join(of_lz4)
    assert "the compression 'zstd' is not known" in ''.join(of_zstd)
