"""Joint forces for states that differ from the factored ones in a few points, with the factor as it is (Woodbury).

The factored equations are given up at the changed points: a unit change of each moves all forces by a column. The
equations that hold there instead say how much of each column there is.
"""

from .dense import factorise, solve, solve_lanes
from .jit import LANES, kernel, summing_kernel
from .joint import OPEN, STICK, slip_sign
from .vector import load, plus_product, store, zeros

MOST_CHANGED = LANES // 2
"""Points; each gives up two equations, and a column of them is a lane. Beyond it a new factor costs less."""


@kernel
def changed_points(factored, state, points):
    """How many states differ from the factored ones, the first of them into `points`; too many where there is no factor."""
    count = 0
    for p in range(state.shape[0]):
        if factored[p] < 0:
            return MOST_CHANGED + 1
        if factored[p] != state[p]:
            if count < points.shape[0]:
                points[count] = p
            count += 1
    return count


@kernel
def prepare(points, kept, n_changed, size, state):
    """Columns of unit changes and the factored matrix of the equations that hold instead; False where that is singular."""
    change = kept.change
    if n_changed == 0:
        return True
    _unit_changes(points, kept, n_changed, size)
    solve_lanes(kept.lu, size, kept.pivot, change.reduced)
    _spread_lanes(points, kept, n_changed)
    for c in range(n_changed):
        p = change.points[c]
        for tangential in range(2):
            row = _product_row(points, state[p], p, tangential, change.forces)
            store(change.matrix, 2 * c + tangential, row)
    return factorise(change.matrix, 2 * n_changed, change.pivot)


@kernel
def _unit_changes(points, kept, n_changed, size):
    """Right-hand sides of the factored unknowns: a unit at an equation of theirs, or the gaps of a unit force that was none."""
    G, reduced = points.G, kept.change.reduced
    for i in range(size):
        store(reduced, i, zeros())
    for c in range(n_changed):
        p = kept.change.points[c]
        k = 0
        for q in range(kept.factored.shape[0]):
            for direction in range(0 if kept.factored[q] == OPEN else (2 if kept.factored[q] == STICK else 1)):
                i = 2 * q + direction
                for tangential in range(2):
                    if kept.factored[p] == OPEN or (tangential == 1 and kept.factored[p] != STICK):
                        reduced[k, 2 * c + tangential] = -G[i, 2 * p + tangential]
                    elif i == 2 * p + tangential:
                        reduced[k, 2 * c + tangential] = 1.0
                k += 1


@kernel
def _spread_lanes(points, kept, n_changed):
    """Forces of all points from the unknowns, for every column; the unit forces are added."""
    factored, reduced, forces = kept.factored, kept.change.reduced, kept.change.forces
    k = 0
    for p in range(factored.shape[0]):
        normal, tangential = zeros(), zeros()
        if factored[p] != OPEN:
            normal = load(reduced, k)
            k += 1
            if factored[p] == STICK:
                tangential = load(reduced, k)
                k += 1
            else:
                tangential = plus_product(zeros(), -slip_sign(factored[p]) * points.mu[p], normal)
        store(forces, 2 * p, normal)
        store(forces, 2 * p + 1, tangential)
    for c in range(n_changed):
        p = kept.change.points[c]
        if factored[p] == OPEN:
            forces[2 * p, 2 * c] += 1.0
        if factored[p] != STICK:
            forces[2 * p + 1, 2 * c + 1] += 1.0


@kernel
def _product_row(points, state, p, tangential, forces):
    """The equation of a point in a state, times forces (m, LANES)."""
    n, s = 2 * p, 2 * p + 1
    if state == OPEN:
        return load(forces, n + tangential)
    if tangential == 1 and state != STICK:
        return plus_product(load(forces, s), slip_sign(state) * points.mu[p], load(forces, n))
    row = n + tangential
    total = plus_product(zeros(), 1.0 / (points.k_s[p] if tangential == 1 else points.k_n[p]), load(forces, row))
    for j in range(forces.shape[0]):
        total = plus_product(total, points.G[row, j], load(forces, j))
    return total


@summing_kernel
def _missing(points, state, p, tangential, source, slip_factor, forces):
    """What the equation of a point in a state lacks with forces (m,)."""
    n, s = 2 * p, 2 * p + 1
    if state == OPEN:
        return forces[n + tangential]
    if tangential == 1 and state != STICK:
        return forces[s] + slip_sign(state) * points.mu[p] * forces[n]
    row = n + tangential
    total = forces[row] / (points.k_s[p] if tangential == 1 else points.k_n[p]) - source[row]
    if tangential == 1:
        total += slip_factor * points.slip[p]
    for j in range(forces.shape[0]):
        total += points.G[row, j] * forces[j]
    return total


@kernel
def corrected(points, change, n_changed, source, slip_factor, state, forces):
    """Bring forces (m,) that solve the factored equations to those of the states."""
    for c in range(n_changed):
        p = change.points[c]
        for tangential in range(2):
            change.rhs[2 * c + tangential] = _missing(points, state[p], p, tangential, source, slip_factor, forces)
    solve(change.matrix, 2 * n_changed, change.pivot, change.rhs)
    for i in range(forces.shape[0]):
        for c in range(2 * n_changed):
            forces[i] -= change.forces[i, c] * change.rhs[c]
