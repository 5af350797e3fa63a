"""The rules of the live page, each without a server: who, what, how often, how long."""

from decimal import Decimal
from importlib import resources
from pathlib import Path

from klann_ros.kinematics import KlannGeometry, KlannLeg
from klann_ros.live.clients import recorded_counts, status_text
from klann_ros.live.drive import CLIENT_TIMEOUT, crank_at, DriveError, LiveCrankDrive, WalkDrive
from klann_ros.live.guard import ForbiddenError, Guard, new_token
from klann_ros.live.legs import (
    assumed_solver,
    drawn_shape,
    joint_positions,
    replayed_solver,
    solver_of,
)
from klann_ros.live.protocol import BURST, Command, parse_message, RATE, RateLimit
from klann_ros.live.rates import TopicRate
from klann_ros.log.run_parameters import replayed_solvers, replayed_solvers_json, SolverParameters
from lab_solver import in_node, NODE
import numpy as np
import pytest
from yaml_tables import read_table

RULES = read_table(Path(__file__).with_name('hostile_requests.yaml'))
LOCAL = Guard('127.0.0.1', 8321, 'secret')
NAMED = Guard('192.0.2.7', 8321, 'secret')
ANY = Guard('0.0.0.0', 8321, 'secret')  # noqa: S104 - bound to nowhere here


@pytest.mark.parametrize('address', RULES['hosts'])
def test_the_host_header_must_name_this_server(address: str) -> None:
    name, port = address.rsplit(':', 1)
    guard = Guard(name, int(port), '')
    hosts = RULES['hosts'][address]
    for host in hosts['own']:
        guard.check_host(host)
    for host in (*hosts['foreign'], '', None):
        with pytest.raises(ForbiddenError):
            guard.check_host(host)


def test_other_machines_need_the_session_token_to_view() -> None:
    LOCAL.check_reading(None)
    for guard in (NAMED, ANY):
        guard.check_reading('secret')
        for token in (None, '', 'Secret', 'secret '):
            with pytest.raises(ForbiddenError):
                guard.check_reading(token)


def test_only_the_whole_token_is_the_token() -> None:
    token = new_token()
    guard = Guard('127.0.0.1', 8321, token)
    assert guard.check_token(token)
    for k in range(len(token)):
        wrong_letter = 'A' if token[k] == 'B' else 'B'
        assert not guard.check_token(token[:k] + wrong_letter + token[slice(k + 1, None)])
        assert not guard.check_token(token[:k])
    assert not guard.check_token(token + 'A')
    assert not guard.check_token(None)


def test_a_read_only_server_drives_with_no_token() -> None:
    assert LOCAL.may_drive('secret')
    assert not Guard('127.0.0.1', 1, 'secret', read_only=True).may_drive('secret')


def test_addresses_hold_the_token() -> None:
    assert LOCAL.url == 'http://127.0.0.1:8321/?token=secret'
    # The runs need it.
    assert Guard('127.0.0.1', 1, 's', read_only=True).url == 'http://127.0.0.1:1/?token=s'
    assert Guard('::1', 1, 's').url.startswith('http://[::1]:1/')
    assert len({new_token() for _ in range(100)}) == 100


def test_messages_of_a_page_are_rate_limited() -> None:
    now = 0.0
    limit = RateLimit(clock=lambda: now)

    def allowed() -> int:
        return sum(limit.take_token() for _ in range(2 * int(BURST)))

    assert allowed() == BURST
    now = 0.25
    assert allowed() == pytest.approx(0.25 * RATE, abs=1)
    # A long silence saves up no more than the burst.
    now = 1e6
    assert allowed() == BURST


def test_valid_commands_are_parsed() -> None:
    assert parse_message('{}') is None
    assert parse_message('{"ack": 3}') == 3
    wish = parse_message(
        '{"id": 1, "command": "set", "target": "/s", "values": {"l": 1, "assembly": [1, -1]}}'
    )
    assert wish == Command(1, 'set', '/s', values={'l': 1.0, 'assembly': [1, -1]})


def test_a_drive_is_lost_within_half_a_second_of_silence() -> None:
    # The thread that asks rests for 50 ms at most.
    assert CLIENT_TIMEOUT + 0.05 < 0.5
    for drive in (LiveCrankDrive(), WalkDrive()):
        assert not drive.is_lost(1e9)
        if isinstance(drive, LiveCrankDrive):
            drive.take(7, 100.0, 1.0)
        else:
            drive.take(7, 100.0)
        assert not drive.is_lost(100.0 + CLIENT_TIMEOUT)
        assert drive.is_lost(100.0 + CLIENT_TIMEOUT + 1e-6)
        drive.alive_at = 101.0
        assert not drive.is_lost(101.2)


def test_a_crank_is_taken_over_at_its_present_angle() -> None:
    drive = LiveCrankDrive()
    drive.take(1, 10.0, 2.0)
    assert drive.advance(11.0) == 2.0
    drive.spin(3.0, 12.0)
    assert drive.advance(13.0) == 5.0
    drive.spin(-1.0, 14.0)
    assert drive.advance(15.0) == 7.0
    drive.turn_to(0.5, 16.0)
    assert drive.advance(20.0) == 0.5
    # What another page commanded ends where this one takes it.
    drive.spin(3.0, 20.0)
    drive.take(2, 21.0, 1.0)
    assert drive.advance(22.0) == 1.0
    walk = WalkDrive(forward=0.2, turn=0.1)
    walk.take(2, 21.0)
    assert (walk.forward, walk.turn) == (0.0, 0.0)
    for refused in (float('nan'), 1e7):
        with pytest.raises(DriveError):
            drive.turn_to(refused, 21.0)
        with pytest.raises(DriveError):
            drive.spin(refused, 21.0)
        for motion in ((refused, 0.0), (0.0, refused)):
            with pytest.raises(DriveError):
                WalkDrive().walk(*motion)


def test_a_crank_is_found_from_its_leg() -> None:
    for alpha, direction, phase in ((1.0, 1.0, 0.0), (1.0, -1.0, 2.0), (-7.0, -1.0, 0.5)):
        assert direction * crank_at(alpha, direction, phase) + phase == pytest.approx(alpha)
    assert crank_at(float('inf'), 1.0, 0.0) == 0.0


def test_a_leg_is_known_by_its_solver() -> None:
    parameters = {
        **KlannGeometry.sem104().as_dict(),
        'assembly': [1, 1],
        'legs': ['a', 'b'],
        'b.l_gh': 0.5,
        'b.direction': -1,
        'b.phase': 1.0,
        'b.mount_xyz': [1.0, 2.0, 3.0],
        'b.mount_rpy': 'upright',
    }
    solver = solver_of(SolverParameters('/x/solver_node', 0, parameters))
    a, b = solver.legs
    assert (a.name, b.name, b.solver.direction, b.solver.phase) == ('a', 'b', -1.0, 1.0)
    assert b.mount_xyz == (1.0, 2.0, 3.0)
    assert b.solver.leg is not None
    assert b.solver.leg.linkage.dimensions['l_gh'] == 0.5
    assert b.joint_names[0] == 'b/alpha'
    assert 'b.l_gh' in solver.lengths
    assert 'use_sim_time' not in solver.lengths
    assert a.as_data()['point'] == 'foot'
    four_bar = resources.files('klann_ros') / 'linkages' / 'four_bar.yaml'
    described = {'linkage_description': four_bar.read_text()}
    (leg,) = solver_of(SolverParameters('/x', 0, described)).legs
    assert leg.as_data()['point'] == 'coupler point'


@pytest.mark.parametrize(
    'parameters',
    [
        {},
        {'legs': 7, 'l_ab': 'x'},
        {'legs': [['a']], 'l_ab': float('nan')},
        {'linkage_description': '{'},
        {'l_ab': 1e308, 'x_d': None, 'assembly': [3, 3]},
        {'legs': ['a'] * 1000},
    ],
)
def test_foreign_parameters_are_ignored(parameters: dict[str, object]) -> None:
    solver = solver_of(SolverParameters('/x', 0, parameters))
    assert all(leg.as_data()['shape'] is None for leg in solver.legs)


def test_a_player_lists_the_legs_of_its_run_by_namespace() -> None:
    """The last lengths hold, and earlier ones are mentioned."""

    def parameters_of(node: str, time: int, **lengths: float) -> SolverParameters:
        geometry = {**KlannGeometry.sem104().as_dict(), 'assembly': [1, 1], **lengths}
        return SolverParameters(node, time, geometry)

    records = [
        parameters_of('/left/solver_node', 1, l_gh=0.5),
        parameters_of('/solver_node', 2, l_gh=0.6),
        parameters_of('/solver_node', 3, l_gh=0.7),
    ]
    read = replayed_solvers(replayed_solvers_json(records))
    assert read == records
    for topic, length, is_changed in (
        ('/again/left/joint_states', 0.5, False),
        ('/again/joint_states', 0.7, True),
    ):
        solver = replayed_solver('/again/player_node', topic, read)
        (leg,) = solver.legs
        assert leg.solver.leg
        assert leg.solver.leg.linkage.dimensions['l_gh'] == length
        assert solver.lengths == {}
        assert ('were changed while it was recorded' in solver.note) is is_changed


@pytest.mark.parametrize('text', ['', '7', '{}', '[7, {}, []]', '[' * 10000, 'null', '"x"'])
def test_invalid_player_records_give_no_leg(text: str) -> None:
    assert replayed_solvers(text) == []


def test_a_node_without_geometry_is_a_klann_leg_or_not_drawn() -> None:
    assumed = assumed_solver('/other', [f'left/{name}' for name in KlannLeg().joint_names])
    assert [leg.name for leg in assumed.legs] == ['left']
    assert 'SEM 104' in assumed.note
    unknown = assumed_solver('/other', ['wheel'])
    assert not unknown.legs
    assert 'not drawn' in unknown.note


def test_the_bounding_box_holds_the_whole_motion() -> None:
    leg = KlannLeg()
    shape = drawn_shape(leg.linkage)
    left, bottom, right, top = shape['box']
    for alpha in np.linspace(0.0, 6.0, 50):
        points = leg.solve(alpha).points
        assert (points >= (left - 1e-3, bottom - 1e-3)).all()
        assert (points <= (right + 1e-3, top + 1e-3)).all()
    assert drawn_shape(KlannLeg().linkage) is shape


def test_a_pose_is_read_from_a_joint_state_or_refused() -> None:
    assert joint_positions(['a', 'b'], ['b', 'x', 'a'], [2.0, 9.0, 1.0]) == [1.0, 2.0]
    assert joint_positions(['a', 'b'], ['a'], [1.0]) is None
    assert joint_positions(['a'], ['a', 'b'], [1.0]) is None
    assert joint_positions(['a'], ['a'], [float('nan')]) is None
    assert joint_positions([], ['a'], [1.0]) is None


def test_a_topic_has_its_rate_and_losses() -> None:
    now = 0.0
    figures = TopicRate(clock=lambda: now)
    figures.publishers = 1
    assert (figures.rate(), figures.silence()) == (0.0, None)
    for number in range(1, 301):
        now += 0.01
        if number % 100:
            figures.add(number)
    assert figures.lost == 2
    assert figures.rate() == pytest.approx(99.0, abs=1.0)
    now += 5.0
    figures.rate()
    assert figures.silence() == pytest.approx(5.01)
    now += 5.0
    assert figures.rate() == 0.0


@pytest.mark.parametrize(
    ('level', 'message', 'meaning'),
    [
        (0, 'solving', 'The leg is solved.'),
        (3, 'no input for 3.1 s', 'The crank is not driven'),
        (2, 'crank angle 1.0 rad (57.296 deg) cannot be reached: dyad 1 does not close', 'reach'),
        (1, 'nearly singular: the links of a dyad are 3.1 deg from in line', 'in line'),
        (1, 'the crank is turned by more than one: /a and /b', 'jumps'),
        (1, 'something of another node', ''),
    ],
)
def test_a_status_is_shown_in_plain_language(level: int, message: str, meaning: str) -> None:
    status = status_text(level, 'solver_node: leg', message, [('solved', '5'), ('x', 'y')])
    assert meaning in status['meaning']
    assert bool(status['meaning']) == bool(meaning)
    assert status['text'] == message
    assert status['figures'] == {'solved': '5'}


def test_a_foreign_status_is_short_and_printable() -> None:
    status = status_text(250, 'x' * 10_000, 'a\u202eb\x1b[31m', [('rate', 'y' * 10_000)] * 1000)
    assert status['level'] == 'error'
    assert len(status['name']) < 150
    assert status['text'].isprintable()
    assert len(status['figures']['rate']) < 100


def test_written_counts_of_recorders_are_summed() -> None:
    values = [
        ('file', '/runs/x written'),
        ('/a written', '5'),
        ('/b written', '7'),
        ('/b lost', '1'),
        ('/c lost', 'unknown'),
        ('/a received', '13'),
        ('/d lost', '9' * 50),
    ]
    assert recorded_counts(values) == {'received': 13, 'written': 12, 'lost': 1}


# Messages of nodes in SI units, and as the page shows them.
TOLD = [
    (
        'crank angle 2.879793 rad (165.000 deg) cannot be reached',
        'crank angle 165° cannot be reached',
    ),
    ('B and D are 0.0123457 m further apart', 'B and D are 12.3457 mm further apart'),
    ('the crank turns at 40 rad/s at most', 'the crank turns at 2291.83°/s at most'),
    ('at most 1 m/s and -3 rad/s', 'at most 1000 mm/s and -171.887°/s'),
    ('residual 1.5e-17 m', 'residual 1.5e-14 mm'),
    ('within +-1e+06 rad', 'within +-57295800°'),
    *[(text, text) for text in ('it must be > 0', '3 messages, 2 m2, 5 m/s², 7 min, 1 rad/s2')],
]
# Refusals of l_ab, and what the page adds to the number as it was typed.
REFUSALS = [
    ('l_ab = -0.003 is refused: a length must be > 0', 'a length must be > 0'),
    (
        'l_ab = 40 rad is refused: a bend must be within +-2 pi rad; if 40 deg are meant, give 1',
        'a bend must be within +-360°',
    ),
    (
        'these lengths are refused: at no crank angle',
        'these lengths are refused: at no crank angle',
    ),
]
# Numbers, digits after the point, and their texts: 0 has no sign.
FIXED = [
    (-0.04, 1, '0.0'),
    (-0.4, 0, '0'),
    (-0.0, 2, '0.00'),
    (-0.05, 2, '-0.05'),
    (10.0, 0, '10'),
]
CONVERSIONS = """
function answer({ texts, refusals, lengths, angles, numbers }) {
  return {
    fixed: numbers.map(([number, digits]) => fixedText(number, digits)),
    refusals: refusals.map((text) => withoutNumber(text, 'left.l_ab')),
    texts: texts.map(inPageUnits),
    metres: lengths.map((length) => inSiUnit(Number(length), 'm')),
    shown: lengths.map((length) => inPageUnit(inSiUnit(Number(length), 'm'), 'm')),
    radians: angles.map((angle) => inSiUnit(angle, 'rad')),
    degrees: angles.map((angle) => inPageUnit(inSiUnit(angle, 'rad'), 'rad')),
  };
}
"""


@pytest.mark.skipif(NODE is None, reason='no node: apt-get install nodejs')
def test_the_page_tells_millimetres_and_degrees_and_sends_si_units_exactly() -> None:
    lengths = [f'{n}.{17 * n % 1000:03}' for n in range(1, 3000)] + ['-0.001', '1e6', '0']
    angles = [0.1 * n for n in range(-3600, 3601)]
    given = {'texts': [sent for sent, _ in TOLD], 'lengths': lengths, 'angles': angles}
    given['refusals'] = [sent for sent, _ in REFUSALS]
    given['numbers'] = [(number, digits) for number, digits, _ in FIXED]
    package = resources.files('klann_ros')
    folder = Path(str(package / 'live' / 'static'))
    scripts = [folder / 'space.js', folder / 'tables.js']
    scripts.insert(0, Path(str(package / 'web' / 'static' / 'theme.js')))
    told = in_node(CONVERSIONS, given, scripts)
    assert told['fixed'] == [text for *_, text in FIXED]
    assert told['refusals'] == [shown for _, shown in REFUSALS]
    assert told['texts'] == [shown for _, shown in TOLD]
    assert told['metres'] == [float(Decimal(length) / 1000) for length in lengths]
    assert told['shown'] == [*map(float, lengths)]
    assert told['radians'] == pytest.approx(np.radians(angles), rel=1e-15)
    assert told['degrees'] == pytest.approx(angles, rel=1e-11)
