"""
The joints of a linkage: body vectors u_j and their derivatives for turning and sliding bodies.

Every body has one coordinate x_j and one vector u_j, which places all its points.
One that turns by an angle has u_j = exp(i s_j x_j), with s_j = -1 where its angle is measured
clockwise. One that slides along a line by a distance has u_j = x_j u_f: the line is turned with
the body f that it is on, its frame, and the ground has u_f = 1. So loops and points are the same
sums for both, f = W u + c and p = Q u + q, and all that differs is how u_j moves:

    turning:   du_j = i s_j u_j dx_j           d2u_j = i s_j u_j d2x_j - u_j dx_j^2
    sliding:   du_j = u_f dx_j + x_j du_f      d2u_j = u_f d2x_j + x_j d2u_f + 2 dx_j du_f

The functions take one pose, or many at once: a coordinate or a vector is a number, or an array.
"""

from cmath import phase
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any, TypeAlias

from klann_ros.kinematics.angles import wrap
import numpy as np

from .structure import FIXED, Structure

# The u_j of every body: complex numbers, or arrays of them.
Vectors: TypeAlias = Any


def vector_sum(terms: Mapping[int, Any], u: Vectors, start: Any) -> Any:
    """Return a start and the sum of W_j u_j: the end of a path."""
    end = start
    for j, w in terms.items():
        end = end + w * u[j]
    return end


def body_vectors(structure: Structure, x: Sequence[Any]) -> list[Any]:
    """Return u_j of every body by its coordinates, the crank's first [rad, m]."""
    u: list[Any] = [None] * len(structure.bodies)
    # Rotating bodies first: they carry the sliding ones.
    for j in sorted(range(len(u)), key=lambda j: structure.bodies[j].slides):
        u[j] = body_vector(structure, u, j, x[j])
    return u


def body_vector(structure: Structure, u: Vectors, j: int, x: Any) -> Any:
    """Return u_j of a body by its coordinate and the vectors of turning bodies."""
    if structure.bodies[j].slides:
        return x * carrier_rotation(structure, u, j)
    return np.exp(1j * structure.senses[j] * np.asarray(x))


def carrier_rotation(structure: Structure, u: Vectors, j: int) -> Any:
    """Return the rotation of the carrier of a sliding body, as a unit vector."""
    frame = structure.frames[j]
    return 1.0 if frame == FIXED else u[frame]


def coordinate(structure: Structure, u: Vectors, j: int) -> Any:
    """Return x_j of a body by the vectors of all: an angle in (-pi, pi], or a distance."""
    if structure.bodies[j].slides:
        return np.real(u[j] * np.conj(carrier_rotation(structure, u, j)))
    if isinstance(u[j], complex):
        return wrap(structure.senses[j] * phase(u[j]))
    angle = structure.senses[j] * np.angle(u[j])
    angle[angle == -np.pi] = np.pi
    return angle


def partial_derivative(structure: Structure, u: Vectors, j: int, i: int) -> Any:
    """Return du_j/dx_i."""
    if structure.bodies[j].slides:
        if i == j:
            return carrier_rotation(structure, u, j)
        # The rotation of its carrier rotates it as well.
        return 1j * structure.senses[i] * u[j] if i == structure.frames[j] else 0.0
    return 1j * structure.senses[j] * u[j] if i == j else 0.0


def jacobian_column(structure: Structure, terms: Mapping[int, complex], u: Vectors, i: int) -> Any:
    """Return the derivative of a sum of W_j u_j by the coordinate of body i."""
    if not structure.slides:
        return 1j * structure.senses[i] * terms.get(i, 0.0) * u[i]
    column = 0.0
    for j, w in terms.items():
        column = column + w * partial_derivative(structure, u, j, i)
    return column + np.zeros(np.shape(u[i]))


def vector_jacobian(structure: Structure, u: Vectors) -> Any:
    """Return du_j/dx_i for every j and i of one pose, shape (n, n)."""
    count = len(structure.bodies)
    jacobian = np.zeros((count, count), dtype=np.complex128)
    for j in range(count):
        for i in {j, structure.frames[j]} - {FIXED}:
            jacobian[j, i] = partial_derivative(structure, u, j, i)
    return jacobian


def vector_velocity(structure: Structure, u: Vectors, x_1: Any, j: int) -> Any:
    """Return du_j of a body by the derivatives of the coordinates."""
    moving = {j, structure.frames[j]} - {FIXED}
    return sum(partial_derivative(structure, u, j, i) * x_1[i] for i in moving)


def velocity_product(
    structure: Structure, u: Vectors, rates: Any, further_rates: Any = None
) -> list[Any]:
    """
    Return the part of d2u_j that is bilinear in two rates of the coordinates.

    Both are dx/dt for an acceleration; for a mixed derivative they are those by two parameters.
    """
    products = []
    further_rates = rates if further_rates is None else further_rates
    for j, body in enumerate(structure.bodies):
        frame = structure.frames[j]
        if frame == FIXED:
            products.append(-u[j] * 0.0)
            continue
        rate = rates[frame]
        further_rate = further_rates[frame]
        product = -u[j] * (rate * further_rate)
        if body.slides:
            slid = rates[j] * further_rate + further_rates[j] * rate
            product = product + 1j * structure.senses[frame] * slid * u[frame]
        products.append(product)
    return products


# The bodies of a block, and a function of du of all bodies and of further openings of its loops:
# the changes of the bodies' coordinates that close the loops again, NaN at a singular pose.
Closing: TypeAlias = tuple[Sequence[int], Callable[[Vectors, Any], Any]]


def solve_rates(
    structure: Structure,
    u: Vectors,
    blocks: Iterable[Closing],
    crank: float,
    *,
    opened: Sequence[Any] = (),
    bent: Sequence[Any] = (),
) -> tuple[list[Any], list[Any]]:
    """
    Return dx and du of all bodies that keep the loops closed: block by block, at many poses.

    `crank` is dx of the crank; `opened` are of each block the openings of its loops at fixed
    coordinates [m], `bent` of each body the part of du that dx does not determine.
    """
    zero = np.zeros(np.shape(u[-1]))
    dx = [zero] * len(u)
    du = list(bent) or [zero] * len(u)
    dx[0] = zero + crank
    du[0] = du[0] + vector_velocity(structure, u, dx, 0)
    for number, (bodies, closing) in enumerate(blocks):
        bent_du = [*du]
        for j in bodies:
            frame = structure.frames[j]
            if frame not in {j, FIXED, *bodies}:
                # Its carrier is solved already.
                du[j] = bent_du[j] + partial_derivative(structure, u, j, frame) * dx[frame]
        changes = closing(du, opened[number] if opened else ())
        for j, change in zip(bodies, changes, strict=True):
            dx[j] = change
        for j in bodies:
            du[j] = bent_du[j] + vector_velocity(structure, u, dx, j)
    return dx, du
