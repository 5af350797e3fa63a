"""
Millions of geometries: solved in chunks by any engine, kept on disk, and gone on with.

>>> import numpy as np, tempfile
>>> from klann_ros.kinematics import KlannGeometry, Variants
>>> from klann_ros.sweeps import sweep_poses
>>> lengths = np.linspace(0.33, 0.36, 1000)
>>> legs = Variants(KlannGeometry.sem104().linkage, {'l_bc': lengths})
>>> folder = tempfile.mkdtemp()
>>> sweep = sweep_poses(legs, np.linspace(0.0, 6.0, 7), folder, chunk=500, jobs=1)
>>> [poses.h.shape for _, poses in sweep]
[(500, 7, 2), (500, 7, 2)]

What is in the folder already is not computed again: the same call goes on where it was stopped.
"""

from .poses import PoseSweep, sweep_poses
from .store import SweepError
from .tolerances import sweep_tolerances

__all__ = ['PoseSweep', 'SweepError', 'sweep_poses', 'sweep_tolerances']
