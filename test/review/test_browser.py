"""A review where Python has neither locks, limits of processes nor compression: in a browser."""

import json
import os
from pathlib import Path
import subprocess
import sys

from klann_ros.review.reviewing import review_run
from leg_runs import LegRun
import pytest

REVIEW = """
import json, sys
sys.modules.update(dict.fromkeys(('fcntl', 'resource', 'lz4', 'zstandard')))
from klann_ros.review import review_run
review = review_run(sys.argv[1])
print(json.dumps([[topic.count for topic in review.topics], [f.text for f in review.findings]]))
"""


@pytest.mark.parametrize('compression', ['none', 'lz4', 'zstd'])
def test_uncompressed_runs_are_reviewed_and_compressed_chunks_reported(
    compression: str, tmp_path: Path
) -> None:
    run = LegRun().write(tmp_path / 'run', compression)
    done = subprocess.run(
        [sys.executable, '-c', REVIEW, run],
        capture_output=True,
        check=True,
        env={**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)},
    )
    counts, findings = json.loads(done.stdout)
    if compression == 'none':
        review = review_run(run)
        assert counts == [topic.count for topic in review.topics]
        assert findings == [finding.text for finding in review.findings]
    else:
        assert any(f"the compression '{compression}' is not known" in text for text in findings)
