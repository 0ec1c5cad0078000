"""A second, slow engine to check the first against: numpy and scipy on the whole, uncondensed system (D1 to D6, D10).

It reads a mesh as arrays and shares no code with `engine`. A step is full Newton-Raphson with the consistent tangent; where that
cycles, Katzenelson's method takes over: the equations are piecewise linear, so the path u(t) of F(u) = (1 - t) F(u_0) is a
polygon that can be walked exactly, from one set of joint states into the next. Coincident joint points are not merged. Triangles
have straight sides, three nodes or six.
"""

from collections import namedtuple

import numpy as np
import scipy.sparse as sp
from numpy.linalg import inv, norm
from numpy.polynomial.legendre import leggauss
from scipy.sparse.linalg import spsolve as solve

OPEN, STICK, FORWARD, BACKWARD = 0, 1, 2, 3
RESIDUAL = 1e-12
"""Largest residual of the whole equation that is accepted, relative to the larger of its load and its joint forces."""


Moment = namedtuple("Moment", "u v a slip state")
"""What a step starts from; the joint states serve damping with joints alone."""

Whole = namedtuple("Whole", "T owner K M B inertia area material")
"""Matrices over the free degrees of freedom (`owner` among those of all nodes, which are T times the free ones); M r of unit
base motion in x and y (n, 2), supported nodes included; area and joint material of every point."""


class Joints(namedtuple("Joints", "B k_n k_s mu slip")):
    """B and the law of all points (D3), (n_point,) each; stiffness times area; slip is that of the last step."""

    def stretch(self, u):
        """(g_n, g_s - slip) of every point."""
        return (self.B @ u).reshape(-1, 2) - np.outer(self.slip, [0, 1])

    def states(self, u):
        g_n, g_s = self.stretch(u).T
        sticks = (abs(self.k_s * g_s) <= -self.mu * self.k_n * g_n) & (self.mu > 0)
        return np.where(g_n >= 0, OPEN, np.where(sticks, STICK, np.where(g_s > 0, FORWARD, BACKWARD)))

    def tangent(self, state):
        """d force / d gap, (n_point, 2, 2), in given states; force = tangent (g_n, g_s - slip)."""
        D = np.zeros((len(state), 2, 2))
        D[:, 0, 0], D[:, 1, 1] = self.k_n * (state != OPEN), self.k_s * (state == STICK)
        D[:, 1, 0] = self.mu * self.k_n * np.choose(state, [0, 0, -1, 1])
        return D

    def force(self, u):
        return np.einsum("pij,pj->pi", self.tangent(self.states(u)), self.stretch(u))

    def slipped(self, u):
        """Slip at the end of a step: kept where the point sticks, else where shear would vanish."""
        return self.slip + np.where(self.states(u) == STICK, 0, self.stretch(u)[:, 1] - self.force(u)[:, 1] / self.k_s)

    def borders(self, state):
        """(n_point, 2, 2): states hold while both products with `stretch` are positive; `walk` says what comes beyond."""
        n, s, rows = self.mu * self.k_n, self.k_s, np.zeros((len(state), 2, 2))
        rows[:, 0, 0], rows[:, 0, 1] = np.choose(state, [1, -n, -1, -1]), np.choose(state, [0, -s, 0, 0])
        rows[:, 1, 0], rows[:, 1, 1] = np.choose(state, [0, -n, n, n]), np.choose(state, [0, s, s, -s]) * (self.mu > 0)
        return rows

    def excess(self, A, load, u):
        """F(u) = A u + B' force - load with the norm that is accepted.

        No less than the rounding of A u, where a box floats, and of k B u, where a joint is stiff.
        """
        force = self.B.T @ self.force(u).ravel()
        sizes = (abs(self.B) @ abs(u)).reshape(-1, 2) + np.outer(abs(self.slip), [0, 1])
        stiff = abs(self.B.T) @ np.einsum("pij,pj->pi", abs(self.tangent(self.states(u))), sizes).ravel()
        accepted = max(RESIDUAL * max(norm(load), norm(force)), np.finfo(float).eps * norm(abs(A) @ abs(u) + stiff))
        return A @ u + force - load, accepted

    def matrix(self, A, state):
        """A with the consistent tangent of the joints in given states."""
        D = sp.bsr_array((self.tangent(state), np.arange(len(state)), np.arange(len(state) + 1)))
        return A + self.B.T @ D @ self.B

    def newton(self, A, load, u, rounds=20):
        """Full Newton-Raphson from u; None where it does not arrive."""
        for _ in range(rounds):
            F, accepted = self.excess(A, load, u)
            if norm(F) <= accepted:
                return u
            u = u - solve(self.matrix(A, self.states(u)), F)
        return None

    def walk(self, A, load, u, rounds=1000):
        """Follow F(u) = (1 - t) F(u_0) to t = 1, backwards in t where the polygon turns; None where it does not arrive."""
        start, state, t, entered = self.excess(A, load, u)[0], self.states(u), 0.0, None
        for _ in range(rounds):
            du, borders = -solve(self.matrix(A, state), start), self.borders(state)
            value = np.einsum("pij,pj->pi", borders, self.stretch(u))
            rate = np.einsum("pij,pj->pi", borders, (self.B @ du).reshape(-1, 2))
            way = 1.0 if entered is None else np.sign(rate[entered])
            reach = np.where(way * rate < 0, np.maximum(value, 0) / np.maximum(-way * rate, 1e-30 * abs(rate).max()), np.inf)
            point, border = np.unravel_index(np.argmin(reach), reach.shape)
            step = reach[point, border]
            if way > 0 and step >= 1 - t:
                return u + (1 - t) * du
            if not np.isfinite(step):
                return None
            u, t, was = u + way * step * du, t + way * step, state[point]
            slides = FORWARD if self.stretch(u)[point, 1] > 0 else BACKWARD
            state[point] = [(slides, slides), (FORWARD, BACKWARD), (OPEN, STICK), (OPEN, STICK)][was][border]
            entered = point, was - FORWARD if state[point] == STICK else int(was == STICK)
        return None

    def solve(self, A, load, u):
        """Solution of F(u) = 0: Newton from u, else from the ends of walks that start ever farther from u."""
        found, rng = self.newton(A, load, u), np.random.default_rng(0)
        for spread in (1e-9, 1e-6, 1e-3, 1e-1, 1.0):
            if found is not None:
                return found
            away = spread * max(abs(u).max(), abs(solve(A, load)).max()) * rng.standard_normal(len(u))
            walked = self.walk(A, load, u + away)
            found = None if walked is None else self.newton(A, load, walked)
        raise ArithmeticError("the reference found no solution")


def joints_of(whole, joint_materials):
    """Joints of these materials that have not slipped."""
    k_n, k_s, mu = np.array([[m.k_n, m.k_s, m.mu] for m in joint_materials], dtype=float)[whole.material].T
    return Joints(whole.B, k_n * whole.area, k_s * whole.area, mu, 0 * mu)


def powers(xy, n):
    """1, x, y and for six nodes x², xy, y² at places (m, 2), (m, n); and their derivatives by x and y (2, m, n)."""
    x, y = np.transpose(xy)
    o, e = 0 * x, 0 * x + 1
    values, by_x, by_y = [e, x, y, x * x, x * y, y * y], [o, e, o, 2 * x, y, o], [o, o, e, o, x, 2 * y]
    return np.transpose(values[:n]), np.array([np.transpose(by_x[:n]), np.transpose(by_y[:n])])


def element(xy, E, nu, rho):
    """Stiffness (2n, 2n) and mass (n, n) of a triangle with straight sides, of unit thickness, from polynomials in x and y."""
    n, middle, size = len(xy), xy[:3].mean(axis=0), np.ptp(xy[:3])
    t, w = leggauss(4)
    r, s = (axis.ravel() for axis in np.meshgrid((t + 1) / 2, (t + 1) / 2))  # a square, folded into the triangle
    places = np.column_stack([r, s * (1 - r), (1 - s) * (1 - r)]) @ xy[:3]
    (ax, ay), (bx, by) = xy[1] - xy[0], xy[2] - xy[0]
    weights = np.outer(w, w).ravel() / 4 * (1 - r) * (ax * by - ay * bx)
    coefficients = inv(powers((xy - middle) / size, n)[0])
    values, slopes = powers((places - middle) / size, n)
    N, (x, y) = values @ coefficients, slopes @ coefficients / size
    strain = np.zeros((len(places), 3, 2 * n))
    strain[:, 0, 0::2], strain[:, 1, 1::2], strain[:, 2, 0::2], strain[:, 2, 1::2] = x, y, y, x
    D = E * nu / ((1 + nu) * (1 - 2 * nu)) * np.outer([1, 1, 0], [1, 1, 0]) + E / (2 * (1 + nu)) * np.diag([2, 2, 1])
    return np.einsum("q,qai,ab,qbj->ij", weights, strain, D, strain), rho * np.einsum("q,qi,qj->ij", weights, N, N)


def along(x, n):
    """Shape functions (n,) at x from 0 to 1 on a side of n nodes: ends, then the middle."""
    return np.array([1 - x, x] if n == 2 else [(1 - x) * (1 - 2 * x), x * (2 * x - 1), 4 * x * (1 - x)])


def assemble(mesh, materials, fixed, master, quadrature="nodal", lumped=False, thickness=1.0):
    """The whole system of a mesh (D1, D2), whose degrees of freedom move as `master` does and not at all where `fixed`."""
    n = 2 * len(mesh.nodes)
    K, M = np.zeros((n, n)), np.zeros((n, n))
    for corners, index in zip(mesh.triangles, mesh.material, strict=True):
        E, nu, rho = materials[index].E, materials[index].nu, materials[index].rho
        k, m = element(mesh.nodes[corners], E, nu, rho)
        dofs = (2 * corners[:, None] + [0, 1]).ravel()
        K[np.ix_(dofs, dofs)] += thickness * k
        M[np.ix_(dofs, dofs)] += thickness * np.kron(np.diag(m.sum(axis=1)) if lumped else m, np.eye(2))
    width = mesh.triangles.shape[1] // 3 + 1
    nodal = [(0.0, 1 / 2), (1.0, 1 / 2)] if width == 2 else [(0.0, 1 / 6), (0.5, 4 / 6), (1.0, 1 / 6)]
    places = [(0.5, 1.0)] if quadrature == "one-point" else nodal
    found = [(e, x, share) for e in range(len(mesh.joints)) for x, share in places]
    B, area = np.zeros((2 * len(found), n)), np.zeros(len(found))
    for row, (e, x, share) in enumerate(found):
        side = mesh.nodes[mesh.joints[e][1]] - mesh.nodes[mesh.joints[e][0]]
        area[row], (c, s) = share * thickness * norm(side), side / norm(side)
        N = along(x, width)
        both = [*-N[:2], *N[1::-1], *-N[2:], *N[2:]]
        for node, N in zip(mesh.joints[e], both, strict=True):
            B[2 * row : 2 * row + 2, 2 * node : 2 * node + 2] += N * np.array([[-s, c], [c, s]])
    group = (2 * master + [0, 1]).ravel()
    owner = np.setdiff1d(group, group[fixed.ravel()])
    T, K, M, B = (sp.csr_array(x, dtype=float) for x in (group[:, None] == owner, K, M, B))
    inertia = T.T @ (M @ np.tile(np.eye(2), (len(mesh.nodes), 1)))
    return Whole(T, owner, T.T @ K @ T, T.T @ M @ T, B @ T, inertia, area, mesh.joint_material[[e for e, _, _ in found]])


def pressure_load(whole, mesh, pressure, thickness=1.0):
    """Load of a nodal pressure on the pressure edges, to their left, by Gauss's three points on every edge."""
    load = np.zeros((len(mesh.nodes), 2))
    for edge in mesh.pressure_edges:
        dx, dy = mesh.nodes[edge[1]] - mesh.nodes[edge[0]]
        for x, weight in zip(*leggauss(3), strict=True):
            N = along((x + 1) / 2, len(edge))
            load[edge] += np.outer(N, [-dy, dx]) * (N @ pressure[edge]) * thickness * weight / 2
    return whole.T.T @ load.ravel()


Equation = namedtuple("Equation", "joints A load u_predicted v_predicted a0 a1")
"""A u + B' force(u) = load of one step, with the joints as they slipped before it, and what u makes of v and a."""


def newmark_equation(whole, joints, start, load, dt, alpha, beta, damped=False, newmark_beta=0.25, newmark_gamma=0.5):
    """The equation of a step under the load at its end (D4 to D6), written with Newmark's predictors; `damped` puts beta on
    the joints too."""
    u, v, a, joints = start.u, start.v, start.a, joints._replace(slip=start.slip)
    acting = np.column_stack([joints.k_n * (start.state != OPEN), joints.k_s * (start.state == STICK)]).ravel()
    C = alpha * whole.M + beta * (whole.K + damped * whole.B.T @ sp.diags_array(acting) @ whole.B)
    u_predicted, v_predicted = u + dt * v + dt**2 * (0.5 - newmark_beta) * a, v + dt * (1 - newmark_gamma) * a
    a0, a1 = 1 / (newmark_beta * dt**2), newmark_gamma / (newmark_beta * dt)
    rhs = load + whole.M @ (a0 * u_predicted) + C @ (a1 * u_predicted - v_predicted)
    return Equation(joints, a0 * whole.M + a1 * C + whole.K, rhs, u_predicted, v_predicted, a0, a1)


def newmark_step(*equation, guess=None, **scheme):
    """One step, the arguments those of `newmark_equation`; Newton starts from `guess`, else from the start of the step."""
    of, start = newmark_equation(*equation, **scheme), equation[2]
    new = of.joints.solve(of.A, of.load, start.u if guess is None else guess)
    moved = new - of.u_predicted
    return Moment(new, of.v_predicted + of.a1 * moved, of.a0 * moved, of.joints.slipped(new), of.joints.states(new))


def static(whole, joints, loads, softness=1e-3, steps=10, most=5000):
    """Equilibrium under loads applied one after the other, by proximal steps; slip is committed at each load step (D10)."""
    shape = solve(joints.matrix(whole.K, np.full(len(joints.mu), STICK)), whole.inertia[:, 0])
    eta = softness * (shape @ whole.inertia[:, 0]) / (shape @ whole.M @ shape)  # near the square of the lowest circular frequency
    u, applied, A, state = 0 * shape, 0 * shape, whole.K + eta * whole.M, joints.states(0 * shape)
    for load in [x for x in loads if x.any()]:
        for part in [applied + load * k / steps for k in range(1, steps + 1)]:
            for _ in range(most):
                before, u = u, joints.solve(A, part + eta * whole.M @ u, u)
                if norm(eta * whole.M @ (u - before)) <= 1e-12 * norm(part):
                    break
            else:
                raise ArithmeticError("the reference found no equilibrium")
            joints, state = joints._replace(slip=joints.slipped(u)), joints.states(u)
        applied = applied + load
    return Moment(u, 0 * u, 0 * u, joints.slip, state)


def march(whole, joints, start, standing, ground, dt, alpha, beta, **scheme):
    """All moments of a history from a static one; the first acceleration solves (D4) at t = 0. Base acceleration (n + 1, 2)."""
    loads = standing - ground @ whole.inertia.T
    force = whole.B.T @ joints._replace(slip=start.slip).force(start.u).ravel()
    moments = [start._replace(a=solve(whole.M, loads[0] - whole.K @ start.u - force))]
    for load in loads[1:]:
        moments.append(newmark_step(whole, joints, moments[-1], load, dt, alpha, beta, **scheme))
    return moments
