"""The parts of a leg: every layer filled as computed, volumes in closed form."""

from klann_ros.export import Part, PartSizes, placed_legs, Role
from klann_ros.robot import robot_of

SIZES = PartSizes(hole=4e-3, width=20e-3, thickness=4e-3, washer=1e-3, clearance=0.3e-3)


def parts_of(name: str) -> tuple[Part, ...]:
    return placed_legs(robot_of(name), SIZES)[0].parts


def test_a_pin_with_its_heads_spacers_and_washers_fills_its_layers() -> None:
    heights = {}
    for part in parts_of('klann'):
        if part.name.endswith(' G'):
            spans = [(round(p.low * 1e3, 6), round(p.high * 1e3, 6)) for p in part.prisms]
            heights.setdefault(part.role, []).extend(spans)
    assert heights == {
        Role.PIN: [(-0.15, 17.35), (-3.35, -0.15)],
        Role.CAP: [(14.15, 17.35)],
        Role.SPACER: [(5.0, 9.0)],
        Role.WASHER: [(4.0, 5.0), (9.0, 10.0)],
    }
