"""Grashof's law: which links of a four-bar linkage turn fully."""

from dataclasses import dataclass
from typing import NamedTuple

from klann_ros.kinematics.linkage.reach import tie

Lengths = tuple[float, float, float, float]

FIXED, ROTATES, OSCILLATES = 'fixed', 'rotates', 'oscillates'


class Roles(NamedTuple):
    """
    What each link does: 'fixed', 'rotates' or 'oscillates'.

    A link rotates if there is a motion of the linkage in which it turns fully against the fixed
    one. That includes motions through the change points of class III, where the assembly changes:
    there the two assemblies meet, and `assembly` is the sign and not the motion. So the rocker of
    `FourBar(2, 1, 2, 1)` rotates, although the sign leads it back at 180 deg.
    """

    ground: str
    crank: str
    coupler: str
    rocker: str


@dataclass(frozen=True)
class Grashof:
    """
    The kind of a four-bar linkage, from s + l against p + q.

    s and l are the shortest and the longest link, p and q the other two.

    Parameters
    ----------
    lengths : tuple of float
        L1 to L4: ground, crank, coupler, rocker [m].
    fixed : str
        Which of them is held: 'ground', or another one for an inversion.

    References
    ----------
    "Mecanismos e Vibracao de Maquinas", Grashof e mecanismos simples, "Lei de Grashof".

    """

    lengths: Lengths
    fixed: str = 'ground'

    def __str__(self) -> str:
        roles = ', '.join(f'{name} {role}' for name, role in self.roles._asdict().items())
        return f'class {self.class_}, {self.type_}: {roles}'

    @property
    def margin(self) -> float:
        """Return p + q - s - l [m]: > 0 in class I, < 0 in class II, rounding in class III."""
        s, p, q, l = sorted(self.lengths)  # noqa: E741 - the law's own letters
        # The differences of neighbours are exact where the law is close.
        return (p - s) - (l - q)

    @property
    def class_(self) -> str:
        """Return 'I' (s + l < p + q), 'II' (>) or 'III' (equal, but for rounding)."""
        margin = self.margin
        if abs(margin) <= tie(self.lengths):
            return 'III'
        return 'I' if margin > 0.0 else 'II'

    @property
    def roles(self) -> Roles:
        """
        Return what each link does, by its name.

        In classes I and III two links turn fully against each other if one of them is a shortest
        one, and oscillate otherwise; in class II all oscillate.
        """
        shortest = min(self.lengths) + tie(self.lengths)
        short = [length <= shortest for length in self.lengths]
        held = Roles._fields.index(self.fixed)
        grashof = self.class_ != 'II'
        names = [ROTATES if grashof and (short[held] or one) else OSCILLATES for one in short]
        names[held] = FIXED
        return Roles(*names)

    @property
    def shape(self) -> str:
        """
        Return what makes a linkage of class III special, '' in the other classes.

        'rhombus' (all equal), 'parallelogram' (opposite links equal; the antiparallelogram is its
        other assembly), 'kite' (neighbours equal: the deltoid), or 'change-point'.
        """
        if self.class_ != 'III':
            return ''
        tolerance = tie(self.lengths)
        l_1, l_2, l_3, l_4 = self.lengths
        if max(self.lengths) - min(self.lengths) <= tolerance:
            return 'rhombus'
        if abs(l_1 - l_3) <= tolerance and abs(l_2 - l_4) <= tolerance:
            return 'parallelogram'
        for one, other in (((l_1, l_2), (l_3, l_4)), ((l_2, l_3), (l_4, l_1))):
            if abs(one[0] - one[1]) <= tolerance and abs(other[0] - other[1]) <= tolerance:
                return 'kite'
        return 'change-point'

    @property
    def motion(self) -> str:
        """
        Return what the fixed link's two neighbours do.

        'crank-rocker', 'rocker-crank', 'double crank', 'double rocker' (only the coupler turns),
        or 'triple rocker' (nothing does). Of an inversion, the next link in the order ground,
        crank, coupler, rocker plays the crank.
        """
        if self.class_ == 'II':
            return 'triple rocker'
        held = Roles._fields.index(self.fixed)
        turns = [self.roles[(held + k) % 4] == ROTATES for k in (1, 3)]
        return {
            (True, True): 'double crank',
            (True, False): 'crank-rocker',
            (False, True): 'rocker-crank',
            (False, False): 'double rocker',
        }[turns[0], turns[1]]

    @property
    def type_(self) -> str:
        """Return shape and motion in one, such as 'crank-rocker' or 'kite double crank'."""
        return f'{self.shape} {self.motion}'.strip()

    @property
    def inversions(self) -> 'dict[str, Grashof]':
        """Return the same with each of the four links fixed, by its name."""
        return {name: Grashof(self.lengths, name) for name in Roles._fields}
