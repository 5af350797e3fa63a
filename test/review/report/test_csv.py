"""The CSV of a run: a row a pose, which pandas reads back bit for bit."""

from dataclasses import replace
import math

from klann_ros.kinematics.klann import JOINTS
from klann_ros.log.reader import open_log
from klann_ros.review.command import main
from leg_runs import STORE
import numpy as np
import pytest

ANGLES = [f'{joint} [rad]' for joint in JOINTS]
RATES = [f'{joint}_rate [rad/s]' for joint in JOINTS]
COLUMNS = [
    'log_time [s]',
    'stamp [s]',
    *ANGLES,
    *RATES,
    'h_x [m]',
    'h_y [m]',
    'residual [m]',
    'angle_error [rad]',
]


@pytest.fixture
def table(tmp_path, capsys):
    """Return what reviews a run and reads its CSV."""
    # Here: it takes a second, in each worker that collects this.
    import pandas as pd

    # Before 3.1 pandas reads doubles to the last bit with an option only.
    version = tuple(map(int, pd.__version__.split('.')[:2]))
    exact = {} if version >= (3, 1) else {'float_precision': 'round_trip'}

    def read(run, **options):
        file = tmp_path / 'run.csv'
        assert main([str(run), '--csv', str(file)]) in (0, 1)
        capsys.readouterr()
        return pd.read_csv(file, **exact, **options)

    return read


def decoded(run, topic):
    """Return the log times of the messages of a topic, and the messages."""
    times = []
    contents = []
    with open_log(run) as log:
        for message in log.messages([topic]):
            times.append(message.log_time)
            contents.append(STORE.deserialize_cdr(message.data, message.topic.type))
    return times, contents


def test_csv_read_by_pandas_equals_the_messages(healthy, make_run, table) -> None:
    healthy.rates = [0.1, -0.2, math.pi, 1e-300, -0.0]
    run = make_run(healthy)
    frame = table(run, dtype={'log_time [s]': str, 'stamp [s]': str})
    assert list(frame.columns) == COLUMNS
    times, poses = decoded(run, '/joint_states')
    _, feet = decoded(run, '/point_h')
    assert len(frame) == len(poses) == 400
    angles = np.array([message.position for message in poses])
    rates = np.array([message.velocity for message in poses])
    h = np.array([(message.point.x, message.point.y) for message in feet])
    # Bit for bit: -0.0 is not 0.0.
    assert frame[ANGLES].to_numpy().tobytes() == angles.tobytes()
    assert frame[RATES].to_numpy().tobytes() == rates.tobytes()
    assert frame[['h_x [m]', 'h_y [m]']].to_numpy().tobytes() == h.tobytes()
    assert frame['log_time [s]'].str.replace('.', '').astype(int).tolist() == [*times]
    stamps = [message.header.stamp.sec * 10**9 + message.header.stamp.nanosec for message in poses]
    assert frame['stamp [s]'].str.replace('.', '').astype(int).tolist() == stamps
    assert frame['residual [m]'].max() < 1e-12
    assert frame['angle_error [rad]'].max() < 1e-12


def test_a_missing_value_is_an_empty_field(healthy, make_run, table) -> None:
    healthy.geometry = None
    healthy.lose('/point_h', 8, 9)
    frame = table(make_run(healthy))
    assert list(frame.columns) == COLUMNS
    assert frame[RATES].isna().all(axis=None)
    assert not frame[ANGLES].isna().any(axis=None)
    assert frame['h_x [m]'].isna().to_numpy().nonzero()[0].tolist() == [7]
    assert frame[['residual [m]', 'angle_error [rad]']].isna().all(axis=None)


def test_only_judged_poses_have_errors_and_odd_numbers_survive(healthy, make_run, table) -> None:
    changed = replace(healthy.geometry, l_gh=0.5)
    healthy.by_crank_state().add_solver(healthy.answers[250].stamp + 200_000, changed)
    # A time before 1970.
    healthy.change(0, header_stamp=-1_500_000_000)
    for index, joint, angle in ((3, 2, math.inf), (4, 3, -math.inf), (5, 4, math.nan)):
        healthy.answers[index].pose[joint] = angle
    frame = table(make_run(healthy), dtype={'stamp [s]': str})
    assert frame['residual [m]'].isna().sum() == 250
    assert frame['residual [m]'][250:].notna().all()
    assert frame['stamp [s]'][0] == '-1.500000000'
    assert (frame['beta [rad]'][3], frame['delta [rad]'][4]) == (math.inf, -math.inf)
    assert math.isnan(frame['theta [rad]'][5])


def test_several_legs_are_named(make_script, make_run, table) -> None:
    first = make_script().in_namespace('/a')
    second = make_script().in_namespace('/b')
    first.others = [second]
    second.change(7, foot=(1.25, -2.5))
    run = make_run(first)
    frame = table(run)
    assert list(frame.columns) == ['leg', *COLUMNS]
    assert frame['leg'].value_counts().to_dict() == {'a': 400, 'b': 400}
    for leg, leg_frame in frame.groupby('leg'):
        _, poses = decoded(run, f'/{leg}/joint_states')
        angles = np.array([message.position for message in poses])
        assert leg_frame[ANGLES].to_numpy().tobytes() == angles.tobytes()
    second_frame = frame[frame['leg'] == 'b']
    assert second_frame[['h_x [m]', 'h_y [m]']].iloc[7].tolist() == [1.25, -2.5]


def test_a_run_without_poses_has_a_header_only(healthy, make_run, table) -> None:
    healthy.answers = []
    healthy.unanswered = [(1000, 1000, 1.0)]
    assert list(table(make_run(healthy)).columns) == COLUMNS
