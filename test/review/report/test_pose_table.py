"""The poses of a reviewed run as a notebook wants them: columns, a data frame."""

import doctest
from pathlib import Path
import subprocess
import sys

from klann_ros import review as face
from klann_ros.kinematics import KlannGeometry, KlannLeg
from klann_ros.review import NoPandasError, pose_arrays, pose_frame, review_run
from klann_ros.review.command import main
from leg_runs import LegRun
import numpy as np
import pytest

PARAMETERS = KlannGeometry().as_dict()
LEG = ('alpha', 'gamma', 'beta', 'delta', 'theta')


@pytest.fixture(scope='module')
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return LegRun(parameters=PARAMETERS).write(tmp_path_factory.mktemp('runs') / 'first')


def test_the_example_of_the_package_runs(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(run.parents[0])
    Path('runs').symlink_to('.')
    examples = doctest.testmod(face, optionflags=doctest.ELLIPSIS)
    assert (examples.attempted > 5, examples.failed) == (True, 0)


def test_all_that_the_package_names_is_there() -> None:
    assert [name for name in face.__all__ if not hasattr(face, name)] == []


def test_a_run_of_many_blocks_is_judged_as_one(run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (whole,) = review_run(run).legs
    monkeypatch.setattr('klann_ros.review.model.poses._BLOCK_SIZE', 7)
    (blockwise,) = review_run(run).legs
    np.testing.assert_array_equal(blockwise.errors.foot_errors, whole.errors.foot_errors)
    np.testing.assert_array_equal(blockwise.errors.angle_errors, whole.errors.angle_errors)


def test_a_frame_has_the_numbers_of_the_csv_file(run: Path, tmp_path: Path) -> None:
    # When called: it takes long, in each worker that collects this.
    import pandas as pd

    main([str(run), '--csv', str(tmp_path / 'run.csv')])
    written = pd.read_csv(tmp_path / 'run.csv', float_precision='round_trip')
    frame = pose_frame(review_run(run, rates='f8'))
    assert list(frame)[:3] == ['time [s]', 'log_time [ns]', 'stamp [ns]']
    pd.testing.assert_frame_equal(written.iloc[:, 2:], frame.iloc[:, 3:], check_exact=True)
    assert frame['time [s]'].tolist()[:2] == pytest.approx([0.0, 0.00502])


def test_a_frame_of_several_legs_names_them(tmp_path: Path) -> None:
    names = ['front', 'rear']
    run = LegRun(dict.fromkeys(names, KlannLeg()), parameters={**PARAMETERS, 'legs': names})
    frame = pose_frame(review_run(run.write(tmp_path / 'run')))
    assert frame.groupby('leg').size().to_dict() == {'front': 400, 'rear': 400}
    assert frame.index.tolist() == list(range(800))


def test_a_frame_is_ones_own(run: Path) -> None:
    review = review_run(run)
    frame = pose_frame(review)
    frame.loc[0, 'alpha [rad]'] = 7.0
    assert review.legs[0].recording.poses.values[0, 0] != 7.0


def test_a_run_without_legs_is_an_empty_frame(tmp_path: Path) -> None:
    run = LegRun(legs={}, iterations=False).write(tmp_path / 'run')
    assert len(pose_frame(review_run(run))) == 0


def test_without_pandas_one_line_names_the_package(
    run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, 'pandas', None)
    review = review_run(run)
    with pytest.raises(NoPandasError) as caught:
        pose_frame(review)
    assert str(caught.value) == "a data frame needs pandas: pip install 'klann_ros[pandas]'"
    assert pose_arrays(review.legs[0])


def test_reviewing_does_not_import_pandas() -> None:
    code = 'import sys, klann_ros.review; sys.exit("pandas" in sys.modules)'
    assert subprocess.run([sys.executable, '-c', code], check=False).returncode == 0
