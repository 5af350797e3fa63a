"""Forces: two methods that share no equation agree, and the laws of mechanics hold."""

from dataclasses import replace
import math
from typing import Any

from change_point_linkages import change_point_linkage, FEET
from klann_ros.dynamics import (
    BodyMass,
    Dynamics,
    MassError,
    Masses,
    masses_from_text,
    rods,
    simulate,
    Spring,
    TorsionSpring,
)
from klann_ros.kinematics import (
    FourBar,
    Linkage,
    LinkageLeg,
    PartialTurnError,
    shipped_linkage,
    shipped_linkages,
)
from klann_ros.kinematics.linkage.file import linkage_from_text, SHIPPED
import numpy as np
from numpy.typing import NDArray
import pytest

Array = NDArray[np.float64]
FORCE = (3.0, -7.0)


def weighed(name: str) -> Dynamics:
    """Return a shipped linkage of rods with a heavy foot, and a spring from it to the crank."""
    linkage = shipped_linkage(name)
    masses = rods(linkage, 1.5, foot_mass=0.3)
    for j, body in enumerate(masses.bodies):
        if not body.mass:  # a slider, which then needs a moment from its line
            masses = masses.with_mass(j, BodyMass(0.1, 0.01 + 0.02j, 1e-4))
    pin = linkage.structure.crank.points[-1]
    springs = (
        Spring((linkage.structure.foot, pin), 20.0, 0.01),
        Spring((pin, (0.3, 0.1)), 15.0, 0.02),
    )
    return Dynamics(linkage, Masses(masses.bodies, springs, torsion_springs(linkage)))


def torsion_springs(linkage: Linkage) -> tuple[TorsionSpring, ...]:
    """Return a spring at each joint away from the crank, at rest in the middle of the arc."""
    structure = linkage.structure
    leg = LinkageLeg(linkage)
    (start, end), *_ = leg.reachable_arcs()
    pose = leg.closed_form((start + end) / 2.0)
    springs = []
    for joint, owners in structure.owners.items():
        if len(owners) > 1 and 0 not in owners:
            names = [structure.angles[j] if j >= 0 else 'ground' for j in owners[:2]]
            spring = TorsionSpring(joint, (names[0], names[1]), 0.7)
            rest_angle = spring.deflection(structure, pose.vectors)
            springs.append(replace(spring, rest_angle=float(rest_angle) + 0.1))
    return tuple(springs)


def angles_of(dynamics: Dynamics, count: int = 41) -> Array:
    """Return crank angles inside of the first arc."""
    (start, end), *_ = LinkageLeg(dynamics.linkage).reachable_arcs()
    inside = 0.02 * (end - start)
    return np.linspace(start + inside, end - inside, count)


@pytest.mark.parametrize('name', shipped_linkages())
def test_energies_and_the_balance_of_every_body_ask_for_the_same_torque(name: str) -> None:
    dynamics = weighed(name)
    alphas, loads = angles_of(dynamics), {dynamics.linkage.structure.foot: FORCE}
    by_energy = dynamics.crank_torque(alphas, 2.0, 3.0, loads)
    by_balance = dynamics.reactions(alphas, 2.0, 3.0, loads).torque
    # In line at a change point a dyad leaves its forces undetermined, not the crank's torque.
    known = ~np.isnan(by_balance)
    assert known.mean() > (0.9 if dynamics.linkage.change_points else 0.999)
    errors = np.abs(by_balance - by_energy)[known]
    assert errors.max() <= 1e-11 * np.abs(by_energy).max()


@pytest.mark.parametrize('name', shipped_linkages())
def test_power_is_the_rate_of_energy(name: str) -> None:
    dynamics, step = weighed(name), 1e-6
    alphas = angles_of(dynamics, 11)

    def energy(crank_angles: Array) -> Array:
        return dynamics.kinetic_energy(crank_angles, 2.0) + dynamics.potential_energy(crank_angles)

    slope = (energy(alphas + step) - energy(alphas - step)) / (2 * step)
    torque = dynamics.crank_torque(alphas, 2.0)
    np.testing.assert_allclose(torque, slope, rtol=0, atol=1e-6 * np.abs(torque).max())


@pytest.mark.parametrize('name', FEET)
def test_at_a_change_point_the_torque_is_the_limit_of_its_neighbours(name: str) -> None:
    linkage = change_point_linkage(name)
    masses = rods(linkage, 1.0)
    for j, body in enumerate(masses.bodies):
        if not body.mass:
            masses = masses.with_mass(j, BodyMass(0.1, 0j, 1e-4))
    dynamics = Dynamics(linkage, masses)
    alphas = np.array([point.beta for point in linkage.change_points.points])
    beside = [dynamics.crank_torque(alphas + step, 2.0) for step in (-2e-4, -1e-4, 1e-4, 2e-4)]
    limit = (4.0 * (beside[1] + beside[2]) - beside[0] - beside[3]) / 6.0
    torque = dynamics.crank_torque(alphas, 2.0)
    np.testing.assert_allclose(torque, limit, rtol=0, atol=1e-7 * np.abs(limit).max() + 1e-12)
    # The forces of a dyad in line are open.
    assert np.isnan(dynamics.reactions(alphas, 2.0).torque).all()


def test_a_turn_has_all_turns_until_the_linkage_is_back() -> None:
    linkage = change_point_linkage('two_turns')
    turn = Dynamics(linkage, rods(linkage, 1.0)).turn(5.0)
    assert turn.alphas[-1] == pytest.approx(4.0 * math.pi * (1.0 - 1.0 / len(turn.alphas)))
    # In one of them the weight does work, in the other as much is taken back.
    one_turn = turn.torque[: len(turn.alphas) // 2]
    assert abs(one_turn.mean()) > 1e-3 * turn.peak
    assert abs(turn.mean) <= 1e-9 * turn.peak


@pytest.mark.parametrize('name', ['klann', 'jansen', 'stephenson', 'quick_return', 'trotbot'])
def test_a_turn_without_loads_takes_no_work(name: str) -> None:
    turn = weighed(name).turn(5.0)
    work = 2 * math.pi * turn.mean
    assert abs(work) <= 1e-12 * turn.energy_swing
    np.testing.assert_array_equal(turn.power, 5.0 * turn.torque)
    assert turn.flywheel(0.1) == pytest.approx(turn.energy_swing / (0.1 * 25.0))


@pytest.mark.parametrize('name', ['klann', 'jansen', 'quick_return'])
def test_the_forces_on_each_body_move_it(name: str) -> None:
    """Newton's law, with accelerations that are differences of places."""
    linkage = shipped_linkage(name)
    dynamics, step, rate = Dynamics(linkage, rods(linkage, 1.0)), 1e-4, 2.0
    alpha = 1.0
    reactions = dynamics.reactions(np.array([alpha]), rate)
    leg = LinkageLeg(linkage)
    places = []
    for k in (-1, 0, 1):
        pose = leg.closed_form(alpha + k * step)
        points = dict(zip(linkage.structure.points, pose.points, strict=True))
        u, frames = pose.vectors, linkage.structure.frames
        rotations = [u[f] if f >= 0 else 1.0 for f in frames]
        starts = [complex(*points[body.points[0]]) for body in linkage.structure.bodies]
        centres = (mass.centre for mass in dynamics.masses.bodies)
        places.append([s + c * t for s, c, t in zip(starts, centres, rotations, strict=True)])
    earlier, present, later = (np.array(step_places) for step_places in places)
    accelerations = (earlier - 2 * present + later) / step**2 * rate**2
    for j, (body, mass) in enumerate(
        zip(linkage.structure.bodies, dynamics.masses.bodies, strict=True)
    ):
        force_sum = sum(
            force[0] for (_, angle), force in reactions.pins.items() if angle == body.angle
        )
        for sliding, (square, _) in reactions.lines.items():
            slider = next(b for b in linkage.structure.bodies if b.angle == sliding)
            bars = [bar for _, bar in linkage.structure.bars]
            line = linkage.bars[bars.index(slider.bars[0])]
            frame = linkage.structure.frames[linkage.structure.angles.index(sliding)]
            direction = 1j * line * (leg.closed_form(alpha).vectors[frame] if frame >= 0 else 1.0)
            force_sum += (
                square[0] * direction * ((sliding == body.angle) - (slider.along == body.angle))
            )
        force_sum += mass.mass * dynamics.gravity
        assert force_sum == pytest.approx(mass.mass * accelerations[j], abs=1e-5)


def test_a_crank_of_a_parallelogram_is_a_pendulum() -> None:
    """All turns as the crank does: T = I a.. + weight times lever, by hand."""
    bar = FourBar(0.3, 0.1, 0.3, 0.1)
    masses = Masses((BodyMass(0.2, 0.05 + 0j, 0.001), BodyMass(0.5, 0.15 + 0j), BodyMass()))
    alphas = np.linspace(0.2, 2.9, 7)
    torque = Dynamics(bar, masses, gravity=(0.0, -10.0)).crank_torque(alphas, 4.0, 6.0)
    inertia = 0.001 + 0.2 * 0.05**2 + 0.5 * 0.1**2
    lever = (0.2 * 0.05 + 0.5 * 0.1) * 10.0
    np.testing.assert_allclose(torque, inertia * 6.0 + lever * np.cos(alphas), rtol=1e-12)


def test_a_simulation_keeps_its_energy() -> None:
    dynamics = weighed('klann')
    simulation = simulate(dynamics, 0.0, np.linspace(0.0, 0.05, 3), alpha=1.0, alpha_rate=4.0)
    energy = dynamics.kinetic_energy(simulation.alpha, simulation.alpha_rate)
    energy = energy + dynamics.potential_energy(simulation.alpha)
    np.testing.assert_allclose(energy, energy[0], rtol=1e-8)


def made(*changes: tuple[str, str]) -> Any:
    text = (SHIPPED / 'four_bar.yaml').read_text(encoding='utf-8')
    text = text.replace('density: 1 ', 'density: 1.0\n')
    text += 'springs: [{from: A, to: [0, 1], stiffness: 5}]\n'
    for change in changes:
        assert change[0] in text
        text = text.replace(*change)
    return masses_from_text(text, linkage_from_text(text, 'x.yaml'), 'x.yaml')


def test_masses_of_a_file_are_those_of_its_rods() -> None:
    linkage = shipped_linkage('four_bar')
    masses = made()
    assert masses.bodies == rods(linkage, 1.0).bodies
    assert masses.springs == (Spring(('A', (0.0, 0.001)), 5.0, 0.0),)
    assert made(('density: 1.0\n', '')) is None


def test_centres_are_in_the_unit_of_the_file() -> None:
    bodies = [
        (f'{name}:\n', f'{name}:\n    mass: 2\n    centre: [30, -4]\n    inertia: 5\n')
        for name in ('theta2', 'theta3', 'theta4')
    ]
    masses = made(('density: 1.0\n', ''), *bodies)
    assert masses.bodies == (BodyMass(2.0, 0.03 - 0.004j, 5.0),) * 3


@pytest.mark.parametrize(
    ('change', 'message'),
    [
        (('density: 1.0', 'density: -1.0'), 'density: -1.0 must be >= 0'),
        (('from: A, to: [', 'from: Z, to: ['), 'springs: Z is none of the points: O2, O4, A, B'),
        (('stiffness: 5', 'stiffness: x'), "springs[0].stiffness: 'x' must be a number"),
        (('theta2:\n', 'theta2:\n    mass: 1\n'), 'has both density and masses: leave one'),
        (('density: 1.0', 'denisty: 1.0'), 'denisty'),
    ],
)
def test_invalid_masses_are_refused_in_one_line(change: tuple[str, str], message: str) -> None:
    with pytest.raises(ValueError) as caught:  # noqa: PT011 - of two kinds
        made(change)
    assert message in str(caught.value)
    assert '\n' not in str(caught.value)


def test_invalid_masses_loads_and_times_are_refused() -> None:
    linkage = shipped_linkage('four_bar')
    with pytest.raises(MassError, match='theta3, theta4 without mass; 0 is allowed'):
        made(('density: 1.0\n', ''), ('theta2:\n', 'theta2:\n    mass: 1\n'))
    with pytest.raises(MassError, match='there are 2 masses for 3 bodies'):
        Dynamics(linkage, Masses((BodyMass(), BodyMass())))
    with pytest.raises(MassError, match=r'mass of body 0 = -1\.0 kg is refused'):
        Masses((BodyMass(-1.0),))
    dynamics = Dynamics(linkage, rods(linkage, 1.0))
    with pytest.raises(MassError, match='load on Q: no such point; there are O2, O4, A, B'):
        dynamics.crank_torque(0.0, loads={'Q': FORCE})
    for force in (1.0, None, (1.0, 2.0, 3.0)):
        with pytest.raises(MassError, match=r'load on A = .* it must be a force \(x, y\)'):
            dynamics.crank_torque(0.0, loads={'A': force})  # type: ignore[dict-item]
    with pytest.raises(MassError, match='loads = 3 is refused: it must be a mapping'):
        dynamics.reactions(0.0, loads=3)  # type: ignore[arg-type]
    rocker = FourBar(0.3, 0.25, 0.2, 0.24)
    with pytest.raises(PartialTurnError):
        Dynamics(rocker, rods(rocker, 1.0)).turn(1.0)
    with pytest.raises(ValueError, match='times are refused'):
        simulate(dynamics, 0.0, [1.0, 0.0], alpha=0.0)


WRONG: Any = [None, 'x', FourBar(0.3, 0.1, 0.25, 0.2).solve(1.0), [1.0, [2.0, 3.0]], 1j, np.eye(2)]


@pytest.mark.parametrize('wrong', WRONG, ids=lambda wrong: type(wrong).__name__)
def test_what_is_no_angle_or_rate_is_refused_by_its_name(wrong: Any) -> None:
    linkage = shipped_linkage('four_bar')
    dynamics = Dynamics(linkage, rods(linkage, 1.0))
    for method in (dynamics.crank_torque, dynamics.reactions):
        with pytest.raises(ValueError, match=r'^alphas is refused: '):
            method(wrong)
        with pytest.raises(ValueError, match=r'^alpha_rate is refused: '):
            method(0.0, wrong)
        with pytest.raises(ValueError, match=r'^alpha_acceleration is refused: '):
            method(0.0, 1.0, wrong)
    with pytest.raises(ValueError, match=r'^alphas is refused: '):
        dynamics.potential_energy(wrong)
    with pytest.raises(ValueError, match=r'^times'):
        simulate(dynamics, 0.0, wrong, alpha=0.0)


def test_what_is_no_dynamics_or_masses_is_refused() -> None:
    linkage = shipped_linkage('four_bar')
    masses: Any = [BodyMass()] * 3
    with pytest.raises(TypeError, match=r'masses = .* is refused: it must be Masses'):
        Dynamics(linkage, masses)
    with pytest.raises(MassError, match=r'= 1\.0 is refused: it must be a BodyMass'):
        Masses((1.0,))  # type: ignore[arg-type]
    with pytest.raises(TypeError, match=r'dynamics = .* is refused'):
        simulate(masses, 0.0, [0.0, 1.0], alpha=0.0)
    with pytest.raises(ValueError, match="torque = 'x' is refused: it must be finite"):
        simulate(Dynamics(linkage, rods(linkage, 1.0)), 'x', [0.0, 1.0], alpha=0.0)  # type: ignore[arg-type]


def test_one_rate_or_as_many_as_angles() -> None:
    linkage = shipped_linkage('four_bar')
    dynamics = Dynamics(linkage, rods(linkage, 1.0))
    assert dynamics.crank_torque([0.0, 1.0], 2.0).shape == (2,)
    one_by_one = [dynamics.crank_torque(0.0, 2.0)[0], dynamics.crank_torque(1.0, 3.0)[0]]
    assert dynamics.crank_torque([0.0, 1.0], [2.0, 3.0]).tolist() == one_by_one
    with pytest.raises(ValueError, match=r'^alpha_rate is refused: its shape must be .* \(2,\)'):
        dynamics.kinetic_energy([0.0, 1.0], [1.0, 2.0, 3.0])
