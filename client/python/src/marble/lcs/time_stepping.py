"""The LCS of one time step of a mechanical system with contacts, from its linearized smooth dynamics.

With the state x = (δq, v), δq in the tangent space at the linearization's q̄, and forces λ in N or N m, the step is

    v₊ = v + h (a + M̂⁻¹ (f_q δq + f_v (v − v̄) + f_u (u − ū))) + h M̂⁻¹ Σ Gᵀ λ,   δq₊ = T δq + h v₊,

where M̂ = M + h D treats damping D implicitly, a = M̂⁻¹ f is the acceleration by the smooth forces f, f_q is the
derivative of f − M a by the configuration at this a, and T that of q̄ ⊕ δq ⊕ h (v̄ + h a) by δq in the tangent space at
q̄. The contacts of a gap φ with the normal row Jn, tangential rows Jt and a friction coefficient μ are one of

- "stewart_trinkle" (Stewart and Trinkle 1996): multipliers γ, λn and one βj per direction j,
      0 ≤ λn ⊥ φ/h + Jn δq₊/h ≥ 0,   0 ≤ βj ⊥ γ + Jtj v₊ ≥ 0,   0 ≤ γ ⊥ μ λn − Σ βj ≥ 0;
- "anitescu" (Anitescu 2006): one λj per direction, a force along Gj = Jn + μ Jtj,
      0 ≤ λj ⊥ φ/h + Jn δq₊/h + μ Jtj v₊ ≥ 0;
- "soft": a spring of stiffness k without friction,
      0 ≤ λ ⊥ φ/h + Jn δq₊/h + λ/(k h) ≥ 0.

In the rigid models a finite stiffness k adds λj/(k h) and λn/(k h) to the rows of the gap. Bodies then sink in a little
and creep where they stick, and multipliers are unique, also of a foot that rests on two points of a plane.
A contact without friction has one row, 0 ≤ λ ⊥ φ/h + Jn δq₊/h ≥ 0, in both of the rigid models; so have joint limits.
In the rigid models φ is at least 0: otherwise a step had to undo all penetration, at the speed φ/h.
The directions are the edges of a pyramid within the friction cone. Anitescu's model lets sliding bodies rise until the
gap is h μ |Jt v|, and is otherwise the same to first order in h.

M. Anitescu, Optimization-based simulation of nonsmooth rigid multibody dynamics, Math. Program. 105 (2006) 113-143.
D. E. Stewart and J. C. Trinkle, An implicit time-stepping scheme for rigid body dynamics with inelastic collisions and
Coulomb friction, Int. J. Numer. Methods Eng. 39 (1996) 2673-2691.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from marble.lcs.rotation import cross_matrix

Array = NDArray[np.float64]

CONTACT_MODELS: Final = ("anitescu", "stewart_trinkle", "soft")
_SMALL: Final = 1e-9  # of the normal's product with an axis, or of a Jacobian


@dataclasses.dataclass(frozen=True)
class SmoothDynamics:
    """The dynamics without contacts at (q̄, v̄, ū), as the module describes them.

    mass (nv, nv); damping (nv, nv), symmetric, the part of −f_v to treat implicitly; acceleration (nv,): a; f_q, f_v
    (nv, nv) and f_u (nv, nu): derivatives of the force; v (nv,); u (nu,); transport (nv, nv): T.
    """

    mass: Array
    damping: Array
    acceleration: Array
    f_q: Array
    f_v: Array
    f_u: Array
    v: Array
    u: Array
    transport: Array


class Contact(NamedTuple):
    """A gap in m or rad, its row normal (nv,), the tangential rows (k, nv), k = 0 without friction; `soft` if the
    contact model "soft" applies to it."""

    gap: float
    normal: Array
    tangents: Array
    friction: float
    soft: bool


def tangent_directions(normal: Array, jacobian: Array, count: int) -> Array:
    """`count` unit vectors across the normal, (count, 3), of which the second half is minus the first half.

    jacobian (3, nv): of the relative velocity. If count is 2, the directions are those in which it can move most.
    """
    axis = np.eye(3)[0 if abs(normal[0]) < 0.9 else 1]
    first = axis - normal * (normal @ axis)
    first /= np.linalg.norm(first)
    second: Array = cross_matrix(normal) @ first
    if count == 2:
        moves = np.stack([first, second]) @ jacobian
        still = np.linalg.svd(moves)[0][:, 1] if jacobian.size else np.array([0.0, 1.0])
        across = still[0] * first + still[1] * second
        leading = int(np.argmax(np.abs(across) > np.abs(across).max() - _SMALL))
        half = (cross_matrix(across if across[leading] > 0 else -across) @ normal)[None]
    else:
        angles = 2 * np.pi * np.arange(count // 2) / count
        half = np.cos(angles)[:, None] * first + np.sin(angles)[:, None] * second
    made: Array = np.concatenate([half, -half])
    return made


def multipliers(tangents: int, contact: str, soft: bool) -> tuple[str, ...]:
    """The names of a contact's multipliers, in their order."""
    if tangents == 0 or (soft and contact == "soft"):
        return ("normal",)
    if contact == "anitescu":
        return tuple(f"edge{j}" for j in range(tangents))
    return ("slip", "normal", *(f"friction{j}" for j in range(tangents)))


def matrices(smooth: SmoothDynamics, contacts: Sequence[Contact], dt: float, contact: str,
             stiffness: float) -> dict[str, Array]:
    """A, B, D, d, E, F, H and c of the LCS, as the module describes it. dt: h in s. contact: one of CONTACT_MODELS.
    stiffness: k in N/m, inf of rigid contacts.
    """
    nv = smooth.v.size
    inverse = np.linalg.inv(smooth.mass + dt * smooth.damping)
    by_q, by_v, by_u = (dt * (inverse @ part) for part in (smooth.f_q, smooth.f_v, smooth.f_u))
    rest = dt * smooth.acceleration - by_v @ smooth.v - by_u @ smooth.u
    by_v += np.eye(nv)
    A = np.block([[smooth.transport + dt * by_q, dt * by_v], [by_q, by_v]])
    B, d = np.concatenate([dt * by_u, by_u]), np.concatenate([dt * rest, rest])

    rows: list[tuple[Array, Array, Array, float]] = []  # of each G (nv), the parts of δq₊/h and of v₊, and a constant
    own: list[tuple[int, int, float]] = []  # entries of F besides those of v₊ and δq₊
    none = np.zeros(nv)
    for one in contacts:
        k, at = len(one.tangents), len(rows)
        is_spring = one.soft and contact == "soft"
        offset = (one.gap if is_spring else max(one.gap, 0.0)) / dt
        if k == 0 or is_spring:
            rows.append((one.normal, one.normal, none, offset))
            if one.soft:
                own.append((at, at, 1 / (stiffness * dt)))
        elif contact == "anitescu":
            rows += [(one.normal + one.friction * t, one.normal, one.friction * t, offset) for t in one.tangents]
            own.extend((at + j, at + j, 1 / (stiffness * dt)) for j in range(k))
        else:
            rows += [(none, none, none, 0.0), (one.normal, one.normal, none, offset),
                     *((t, none, t, 0.0) for t in one.tangents)]
            own += [(at, at + 1, one.friction), (at + 1, at + 1, 1 / (stiffness * dt))]
            own.extend(entry for j in range(k) for entry in ((at, at + 2 + j, -1.0), (at + 2 + j, at, 1.0)))
    nl = len(rows)
    G, of_q, of_v = (np.array([row[part] for row in rows]).reshape(nl, nv) for part in range(3))
    impulses = dt * (inverse @ G.T)
    D = np.concatenate([dt * impulses, impulses])
    weights = np.hstack([of_q / dt, of_v])
    F = weights @ D
    for row, column, value in own:
        F[row, column] += value
    return {"A": A, "B": B, "D": D, "d": d, "E": weights @ A, "F": F, "H": weights @ B,
            "c": weights @ d + np.array([row[3] for row in rows])}
