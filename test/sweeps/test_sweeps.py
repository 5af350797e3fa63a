"""A sweep in chunks is the batch, however it was come by."""

from pathlib import Path

from klann_ros.kinematics import KlannGeometry, linkage_poses, tolerance_study, Variants
from klann_ros.sweeps import sweep_poses, sweep_tolerances, SweepError
import numpy as np
import pytest

SEM104 = KlannGeometry.sem104().linkage
ALPHAS = np.linspace(0.0, 6.0, 7)
# One of them is no leg.
LEGS = Variants(SEM104, {'l_bc': [*np.linspace(0.3, 0.4, 24), -1.0]})


def test_a_sweep_is_the_batch_in_chunks(tmp_path: Path) -> None:
    sweep = sweep_poses(LEGS, ALPHAS, tmp_path / 's', chunk=10, jobs=2, angles=True)
    whole = linkage_poses(LEGS, ALPHAS, angles=True)
    assert len(sweep) == 3
    for part, poses in sweep:
        # An array of another length may be rounded otherwise, by the processor's lanes.
        np.testing.assert_allclose(poses.h, whole.h[part], rtol=0, atol=1e-15)
        np.testing.assert_allclose(poses.angles, whole.angles[part], rtol=0, atol=1e-14)
        np.testing.assert_array_equal(poses.reason, whole.reason[part])
        assert poses.points is None


def test_a_sweep_resumes_after_an_interrupt(tmp_path: Path) -> None:
    folder = tmp_path / 's'
    sweep_poses(LEGS, ALPHAS, folder, chunk=5, jobs=1)
    kept = folder / 'chunk_000001.npz'
    before = kept.stat().st_mtime_ns
    (folder / 'chunk_000003.npz').unlink()
    done: list[tuple[int, int]] = []
    sweep = sweep_poses(
        LEGS, ALPHAS, folder, chunk=5, jobs=1, progress=lambda *now: done.append(now)
    )
    assert done == [(5, 5)]
    assert kept.stat().st_mtime_ns == before
    found = linkage_poses(LEGS, ALPHAS).h[15:20]
    np.testing.assert_allclose(sweep[3].h, found, rtol=0, atol=1e-15)


def test_a_folder_of_another_sweep_is_refused(tmp_path: Path) -> None:
    sweep_poses(LEGS, ALPHAS, tmp_path / 's', jobs=1)
    with pytest.raises(SweepError, match='holds another sweep'):
        sweep_poses(LEGS, ALPHAS + 1e-15, tmp_path / 's', jobs=1)
    (tmp_path / 'mine').mkdir()
    (tmp_path / 'mine' / 'thesis.txt').touch()
    with pytest.raises(SweepError, match='not empty'):
        sweep_poses(LEGS, ALPHAS, tmp_path / 'mine', jobs=1)
    assert [path.name for path in (tmp_path / 'mine').iterdir()] == ['thesis.txt']


def test_refusals_leave_no_files(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match='chunk = 0'):
        sweep_poses(LEGS, ALPHAS, tmp_path / 's', chunk=0)
    with pytest.raises(TypeError):
        sweep_poses(LEGS, ALPHAS, tmp_path / 's', angels=True)
    assert list(tmp_path.iterdir()) == []


def test_a_study_in_parts_is_the_study(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr('klann_ros.kinematics.batch.tolerance_study.MAX_STUDY_POSES', 400)
    tolerances = {'l_bc': 0.0005, 'angle_bcg': 0.002}
    asked = {'samples': 100, 'crank_angles': 12, 'seed': 3}
    # In this very process, so that it has the smaller parts as well.
    whole = tolerance_study(SEM104, tolerances, **asked)
    swept = sweep_tolerances(SEM104, tolerances, tmp_path / 's', jobs=1, **asked)
    for name in ('mean', 'rms', 'p95', 'p99', 'largest', 'box', 'stride', 'sensitivities'):
        np.testing.assert_array_equal(getattr(swept, name), getattr(whole, name))
    assert swept.non_turning_fraction == whole.non_turning_fraction
    assert swept.ranking == whole.ranking
