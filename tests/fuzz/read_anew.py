"""What the dataset says of a case, worked out anew: every step of the march is filmed, and each variable formed from the film.

The formulas are those of the tests' slow engine and of numpy; what is linear in the film may differ by the rounding of its terms.
"""

from collections import namedtuple
from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np
import scipy.linalg
import xarray as xr

from engine import Model, Spec, base_motion, simulate_cases
from engine.mesh import Mesh, Section
from engine.model import materials
from studies import Study
from studies.schema import SCHEMA
from tests import reference
from tests.twin import Twin, gravity_of, twin_of_model, water_on

ROUNDING = 1e-12
"""Of the sum of the magnitudes of what is added up: some thousand terms, each known to a few units."""

STATIC = 1e-8
"""Of the loads, left in the equilibrium before the shaking: a hundred times what the static stage leaves in a step."""

MARCHED = 1e-9
"""Of the largest displacement, between two marches of one linear system."""

Film = namedtuple("Film", "time u v a gap force damped slip state")
"""Every step from t = 0: time [s], motion (n_time, 2 n_node), joints (n_time, n_point, 2), slip and state (n_time, n_point)."""

Linear = namedtuple("Linear", "value magnitude")
"""A value, and the sum of the magnitudes of its terms."""


@dataclass
class _Reading:
    """A case of a dataset beside what was worked out anew; `wrong` collects what differs."""

    ds: xr.Dataset
    every: int
    wrong: list[str] = field(default_factory=list)

    def compare(self, name: str, expected: np.ndarray, allowed: np.ndarray | float = 0.0) -> None:
        """Values (…) of a variable; NaN stands for NaN."""
        found, expected = self.ds[name].values, np.asarray(expected)
        if found.shape != expected.shape:
            self.wrong.append(f"{name}: has the shape {found.shape}, not {expected.shape}")
            return
        apart = np.where(np.isnan(expected) & np.isnan(found), 0.0, abs(found.astype(float) - expected))
        if not (apart <= allowed).all():
            self.wrong.append(f"{name}: differs by {np.max(apart - allowed):.1e} from {np.nanmax(abs(expected)):.1e}")

    def compare_history(self, name: str, expected: Linear) -> None:
        """A value that is linear in the film, of every step, of which the dataset keeps every so many."""
        value, magnitude = expected.value[:: self.every], expected.magnitude[:: self.every]
        self.compare(name, value, ROUNDING * magnitude + (_single(value) if SCHEMA[name].single else 0.0))

    def compare_peak(self, name: str, expected: Linear) -> None:
        """Its largest magnitude of all steps."""
        self.compare(name, abs(expected.value).max(axis=0), ROUNDING * expected.magnitude.max(axis=0))


def misread(study: Study, ds: xr.Dataset, model: Model, cases: list[int]) -> list[str]:
    """Variables of these cases, which are solved and done, that are not what their march gives; `ds` is that of the study."""
    twin, found = twin_of_model(model), []
    for case in cases:
        spec, ground = study.cases[case], study.ground(case)
        reading = _Reading(_case(study, ds, case), spec.output.every)
        film = _filmed(model, spec, ground)
        _read_base(reading, study, spec, ground)
        _read_model(reading, model, twin)
        _read_materials(reading, model, spec)
        _read_static(reading, model, spec, twin, film)
        _read_points(reading, model.system.mesh, materials(spec), film)
        _read_joints(reading, model, spec, twin, film)
        _read_racking(reading, model.system.mesh, film)
        _read_sections(reading, model, spec, twin, film, ground)
        _read_free_field(reading, model, spec, ground)
        found += [f"case {case}: {line}" for line in reading.wrong]
    return found + [line for case in cases for line in _followers_misread(study, ds, case)]


def _single(values: np.ndarray) -> np.ndarray:
    """What single precision may lose of values."""
    of = np.finfo(np.float32)
    return of.eps * abs(values) + of.smallest_subnormal


def _case(study: Study, ds: xr.Dataset, case: int) -> xr.Dataset:
    at = np.unravel_index(case, study.shape)
    return ds.isel({axis.name: i for axis, i in zip(study.axes, at, strict=True)})


def _filmed(model: Model, spec: Spec, ground: np.ndarray) -> Film:
    expand, frames = model.system.expand, []

    def frame(step):
        motion, contact = step.state.motion, step.state.contact
        joints = [x[0].reshape(-1, 2) for x in (contact.gap, contact.force, contact.damped)]
        frames.append([step.time, *(expand @ x[:, 0] for x in motion), *joints, contact.slip[0], contact.state[0]])

    simulate_cases(model, [spec], [ground], trace=frame)
    return Film(*(np.array(each) for each in zip(*frames, strict=True)))


# ---- motion, model, static state ----


def _read_base(reading: _Reading, study: Study, spec: Spec, ground: np.ndarray) -> None:
    """What is known without a march: the base moves as the study says, to the peaks that it names; the water lifts the box."""
    motion, box = spec.motion, spec.box
    plain = motion.model_copy(update={"peak": None, "vertical_peak": None, "scale": 1.0})
    unscaled = base_motion(spec.model_copy(update={"motion": plain}), study.motions)
    size = abs(unscaled).max(axis=0)
    across = 1.0 if motion.peak is None or size[0] == 0 else motion.peak / size[0]
    upwards = across if motion.vertical_peak is None or size[1] == 0 else motion.vertical_peak / size[1]
    expected = unscaled * [across, upwards] * motion.scale
    if not np.allclose(ground, expected, rtol=1e-12, atol=1e-50 * abs(ground).max()):
        reading.wrong.append("base_acceleration: does not have the peaks that the study names")
    reading.compare("base_acceleration", ground[:: reading.every])
    reading.compare("peak_base_acceleration", abs(ground).max(axis=0))
    hollow = (box.width - 2 * box.wall) * (box.height - 2 * box.wall)
    weight = (box.width * box.height - hollow) * box.density * spec.gravity.acceleration
    floor, roof = (spec.pressure.p0 * depth / spec.pressure.reference_height for depth in (box.depth + box.height, box.depth))
    reading.compare("uplift_over_weight", (floor - roof) * box.width / weight, 1e-9 * abs(floor) * box.width / weight)


def _read_model(reading: _Reading, model: Model, twin: Twin) -> None:
    """Frequencies of the bonded system, and the damping that follows from the first two."""
    whole, joints = twin.whole, reference.joints_of(twin.whole, model.system.joint_materials)
    bonded = joints.matrix(whole.K, np.full(len(joints.mu), reference.STICK)).toarray()
    values = scipy.linalg.eigh(bonded, whole.M.toarray(), eigvals_only=True)
    count = reading.ds.sizes["mode"]
    allowed = 1e-8 * values[:count] + 100 * np.finfo(float).eps * values[-1]
    found = (2 * np.pi * reading.ds.frequency.values) ** 2
    if not (abs(found - values[:count]) <= allowed).all():
        reading.wrong.append(f"frequency: squares differ by {max(abs(found - values[:count]) / values[:count]):.1e}")
    w, damping = 2 * np.pi * reading.ds.frequency.values[:2], model.rayleigh
    if not np.allclose(damping.alpha / (2 * w) + damping.beta * w / 2, model.spec.damping.ratio, rtol=1e-9, atol=0):
        reading.wrong.append("damping: its coefficients do not give the ratio at the first two frequencies")


def _read_materials(reading: _Reading, model: Model, spec: Spec) -> None:
    """Ground is of the layer in which its middle lies, joints take their stiffness and friction from the ground beside them."""
    mesh, joints = model.system.mesh, model.joint_materials(spec)
    depth, ends = -mesh.nodes[mesh.triangles[:, :3], 1].mean(axis=1), [layer.bottom for layer in spec.layer[:-1]]
    layer_of = np.where(mesh.structure, len(spec.layer), np.searchsorted(ends, depth))
    if not np.array_equal(layer_of, mesh.material):
        reading.wrong.append("materials: triangles are not of the layers in which they lie")
    for nodes, group in zip(mesh.joints, mesh.joint_material, strict=True):
        (beside,) = np.flatnonzero(np.isin(mesh.triangles[:, :3], nodes[:2]).sum(axis=1) == 2)
        layer, joint = spec.layer[layer_of[beside]], spec.joint
        E, nu = layer.E, layer.nu
        length = np.linalg.norm(mesh.nodes[nodes[1]] - mesh.nodes[nodes[0]])
        thickness = joint.thickness if joint.thickness_ratio is None else joint.thickness_ratio * length
        wanted = [E * (1 - nu) / ((1 + nu) * (1 - 2 * nu)) / thickness, E / (2 * (1 + nu)) / thickness, layer.friction]
        if not np.allclose([joints[group].k_n, joints[group].k_s, joints[group].mu], wanted, rtol=1e-9, atol=0):
            reading.wrong.append(f"materials: the joint between nodes {nodes} is not that of the ground beside it")


def _read_static(reading: _Reading, model: Model, spec: Spec, twin: Twin, film: Film) -> None:
    """Before the shaking the joint forces keep within their law, and hold loads and elastic forces in balance."""
    whole, mesh = twin.whole, model.system.mesh
    load = reference.pressure_load(whole, mesh, water_on(mesh, spec)) - gravity_of(spec) * whole.inertia[:, 1]
    normal, shear = film.force[0].T
    mu = model.system.joint_law(model.joint_materials(spec))[2]
    size = abs(film.force[0]).max(initial=0.0)
    if (normal > 0).any() or (abs(shear) > -mu * normal + ROUNDING * size).any():
        reading.wrong.append("static state: the joint pulls, or carries more than friction allows")
    force = film.force[0][twin.point] * (whole.area / model.system.points.area[twin.point])[:, None]
    u = film.u[0][whole.owner]
    left = whole.K @ u + whole.B.T @ force.ravel() - load
    allowed = STATIC * np.linalg.norm(load) + ROUNDING * np.linalg.norm(
        abs(whole.K) @ abs(u) + abs(whole.B.T) @ abs(force).ravel()
    )
    if not np.linalg.norm(left) <= allowed:
        reading.wrong.append(f"static state: {np.linalg.norm(left):.1e} N of {np.linalg.norm(load):.1e} N are not balanced")


# ---- points and racking ----


def _applied(rows: np.ndarray, u: np.ndarray) -> Linear:
    """rows (…, n) on u (n_time, n): values (n_time, …)."""
    flat = rows.reshape(-1, rows.shape[-1])
    shape = len(u), *rows.shape[:-1]
    return Linear((u @ flat.T).reshape(shape), (abs(u) @ abs(flat).T).reshape(shape))


def _interpolated(rows: np.ndarray, u: np.ndarray) -> Linear:
    """The same for components (n, c, 2 n_node) in triangles, whose small factors are the differences of large ones."""
    touched = (rows != 0).any(axis=1, keepdims=True)
    return Linear(_applied(rows, u).value, _applied(touched * abs(rows).max(axis=2, keepdims=True), u).magnitude)


def _from_start(of: Linear) -> Linear:
    return Linear(of.value - of.value[0], of.magnitude + of.magnitude[0])


def _read_points(reading: _Reading, mesh: Mesh, material: list, film: Film) -> None:
    probes, n = mesh.probes.values(), 2 * len(mesh.nodes)
    stress_rows, displacement_rows = np.zeros((len(probes), 4, n)), np.zeros((len(probes), 2, n))
    for p, probe in enumerate(probes):
        at = np.array([probe.x, probe.y])
        for t, weight in zip(probe.triangles, probe.triangle_weights, strict=True):
            stress_rows[p] += weight * _stress(mesh, t, material[mesh.material[t]], at)
        nodes = mesh.triangles[probe.triangles[0]]
        N, _ = _shape(mesh.nodes[nodes], at)
        for c in range(2):
            displacement_rows[p, c, 2 * nodes + c] = N
    displacement, stress = _interpolated(displacement_rows, film.u), _interpolated(stress_rows, film.u)
    for name, of in (("displacement", displacement), ("stress", stress)):
        reading.compare_history(name, of)
        reading.compare_peak(f"peak_{name}", of)
        reading.compare_peak(f"peak_{name}_dynamic", _from_start(of))
    xx, yy, xy, zz = np.moveaxis(stress.value, -1, 0)
    zero = 0 * xx
    principal = np.linalg.eigvalsh(np.moveaxis(np.array([[xx, xy, zero], [xy, yy, zero], [zero, zero, zz]]), (0, 1), (-2, -1)))
    size = stress.magnitude.sum(axis=-1)
    reading.compare_history("principal_stress", Linear(principal[..., ::-1], np.repeat(size[..., None], 3, axis=-1)))
    reading.compare("max_principal_stress", principal.max(axis=(0, -1)), ROUNDING * size.max(axis=0))
    reading.compare("min_principal_stress", principal.min(axis=(0, -1)), ROUNDING * size.max(axis=0))


def _shape(xy: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Shape functions (n,) and their slopes (2, n) of a triangle with straight sides at a place, from polynomials in x and y."""
    middle, size = xy[:3].mean(axis=0), np.ptp(xy[:3])
    coefficients = np.linalg.inv(reference.powers((xy - middle) / size, len(xy))[0])
    values, slopes = reference.powers((at - middle)[None] / size, len(xy))
    return values[0] @ coefficients, slopes[:, 0] @ coefficients / size


def _stress(mesh: Mesh, triangle: int, material, at: np.ndarray) -> np.ndarray:
    """Rows (4, 2 n_node) of xx, yy, xy, zz by Lamé's constants."""
    nodes, E, nu = mesh.triangles[triangle], material.E, material.nu
    lame, shear = E * nu / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu))
    x, y = _shape(mesh.nodes[nodes], at)[1]
    rows = np.zeros((4, 2 * len(mesh.nodes)))
    for c, slope in enumerate((x, y)):
        rows[[0, 1, 3], (2 * nodes + c)[:, None]] += lame * slope[:, None]
        rows[c, 2 * nodes + c] += 2 * shear * slope
        rows[2, 2 * nodes + c] += shear * (y, x)[c]
    return rows


def _read_racking(reading: _Reading, mesh: Mesh, film: Film) -> None:
    """Roof over invert; then without the rotation of both, which the columns of corners tell by their heights."""
    left, right, low_right, low_left = mesh.corners
    width, height = mesh.nodes[right, 0] - mesh.nodes[left, 0], mesh.nodes[left, 1] - mesh.nodes[low_left, 1]
    rows = np.zeros((2, 2 * len(mesh.nodes)))
    rows[:, 2 * np.array([left, right])], rows[:, 2 * np.array([low_left, low_right])] = 0.5, -0.5
    rotation = np.zeros(2 * len(mesh.nodes))  # counter-clockwise, which moves the roof to the left
    rotation[2 * np.array([right, low_right]) + 1], rotation[2 * np.array([left, low_left]) + 1] = 0.5 / width, -0.5 / width
    rows[1] += height * rotation
    racking, shear = (_applied(row, film.u) for row in rows)
    for name, of in (("racking", racking), ("racking_shear", shear)):
        reading.compare_history(name, of)
        reading.compare_peak(f"peak_{name}", of)
    reading.compare_peak("peak_racking_dynamic", _from_start(racking))
    moved = _from_start(shear)
    ds, dynamic = reading.ds, abs(moved.value).max()
    if np.isfinite(ds.racking_ratio):
        free = float(ds.peak_racking_free_field)
        reading.compare("racking_ratio", dynamic / free, ROUNDING * moved.magnitude.max() / free)
    k = int(np.argmin(abs(film.time - float(ds.shape_time))))
    if abs(racking.value).max() - abs(racking.value[k]) > ROUNDING * racking.magnitude.max():
        reading.wrong.append("shape_time: is not when the racking was largest")
    reading.compare("shape_time", film.time[k])
    reading.compare("shape", film.u[k].reshape(-1, 2), ROUNDING * abs(film.u[k]).max())
    reading.compare("shape_state", film.state[k])


def _read_free_field(reading: _Reading, model: Model, spec: Spec, ground: np.ndarray) -> None:
    """The ground without the box: three-node triangles that move alike at every depth are linear elements of one dimension."""
    mesh, damping = model.system.mesh, model.rayleigh
    if mesh.order == 2:
        return
    y = np.unique(mesh.nodes[mesh.boundaries["left"], 1])
    h, middle = np.diff(y), (y[:-1] + y[1:]) / 2
    layers = [next((layer for layer in spec.layer if -at < layer.bottom), spec.layer[-1]) for at in middle]
    rho, G = (np.array([getattr(layer, name) for layer in layers]) for name in ("rho", "shear_modulus"))
    lumped = spec.mesh.mass == "lumped"
    K, M = (_chain(G / h, [[1, -1], [-1, 1]]), _chain(rho * h / 6, [[3, 0], [0, 3]] if lumped else [[2, 1], [1, 2]]))
    load = -np.outer(ground[:, 0], M.sum(axis=1))[:, 1:]  # of the whole rows: the base moves, too
    K, M = K[1:, 1:], M[1:, 1:]
    C, time = damping.alpha * M + damping.beta * K, spec.time
    a0, a1 = 1 / (time.newmark_beta * time.dt**2), time.newmark_gamma / (time.newmark_beta * time.dt)
    u = v = np.zeros(len(K))
    a, inverse, history = np.linalg.solve(M, load[0]), np.linalg.inv(a0 * M + a1 * C + K), [u]
    for force in load[1:]:
        u_free = u + time.dt * v + time.dt**2 * (0.5 - time.newmark_beta) * a
        v_free = v + time.dt * (1 - time.newmark_gamma) * a
        u = inverse @ (force + M @ (a0 * u_free) + C @ (a1 * u_free - v_free))
        v, a = v_free + a1 * (u - u_free), a0 * (u - u_free)
        history.append(u)
    moved = np.pad(np.array(history), ((0, 0), (1, 0)))
    heights = -spec.box.depth, -spec.box.depth - spec.box.height
    roof, invert = (np.array([np.interp(height, y, each) for each in moved]) for height in heights)
    racking, allowed = roof - invert, MARCHED * abs(moved).max()
    reading.compare("racking_free_field", racking[:: reading.every], allowed)
    reading.compare("peak_racking_free_field", abs(racking).max(), allowed)
    reading.compare("reference_displacement", np.zeros(reading.ds.reference_displacement.shape))  # at the base


def _chain(factor: np.ndarray, block: list[list[int]]) -> np.ndarray:
    """Elements in a row, each a factor times the block (2, 2)."""
    whole = np.zeros((len(factor) + 1,) * 2)
    for i, times in enumerate(factor):
        whole[i : i + 2, i : i + 2] += times * np.array(block)
    return whole


# ---- joints ----


def _read_joints(reading: _Reading, model: Model, spec: Spec, twin: Twin, film: Film) -> None:
    length = np.bincount(twin.point, twin.whole.area, minlength=len(model.system.points))  # a metre thick
    _, k_s, mu = model.system.joint_law(model.joint_materials(spec))
    is_open, slides, kept = film.state == reference.OPEN, film.state > reference.STICK, slice(None, None, reading.every)
    pressure, opening = -film.force[..., 0] / length, film.gap[..., 0]
    share = 1e-10  # lengths are differences of places
    reading.compare("joint_length", length, share * length)
    reading.compare("open_fraction", (is_open @ length / length.sum())[kept], share)
    reading.compare("opened_length", (is_open @ length)[kept], share * length.sum())
    reading.compare("slip_fraction", (slides @ length / length.sum())[kept], share)
    reading.compare("closed_before_shaking", (~is_open[0] @ length) / length.sum(), share)
    reading.compare("joint_state", film.state[kept])
    reading.compare("joint_pressure", pressure[kept], _single(pressure[kept]))
    reading.compare("joint_slip", film.slip[kept], _single(film.slip[kept]))
    reading.compare("max_opening", opening.max(axis=0, initial=0.0))
    reading.compare("penetration", (-opening).max(initial=0.0))
    reading.compare("max_slip", abs(film.slip).max(axis=0))
    reading.compare("max_pressure", pressure.max(axis=0, initial=0.0), share * abs(pressure).max(axis=0))
    reading.compare("gap_before_shaking", opening[0])
    limit = mu * abs(film.force[0, :, 0]) / k_s
    slid = ~is_open & (abs(film.slip - film.slip[0]) > limit)
    first = film.time[np.argmax(slid, axis=0)]
    reading.compare("first_slip", np.where(slid.any(axis=0), first, np.nan))
    if reading.ds.status == 0:  # no step was halved: then the film has all there was
        steps = film.force[1:, :, 1] * np.diff(film.slip, axis=0)
        work = np.concatenate([np.zeros((1, len(length))), np.cumsum(steps, axis=0)])
        size = abs(steps).sum(axis=0)
        reading.compare("slip_work", work.sum(axis=1)[kept], ROUNDING * size.sum())
        reading.compare("joint_slip_work", work[-1] / length, share * size / length)


# ---- sections ----


def _read_sections(reading: _Reading, model: Model, spec: Spec, twin: Twin, film: Film, ground: np.ndarray) -> None:
    """N, Q, M from the balance of the cut's nodes with the triangles, joints, pressure and weight behind it."""
    found = [_section(model, spec, twin, film, ground, section) for section in model.system.mesh.sections.values()]
    value, magnitude = (np.stack([of[i] for of in found], axis=1) for i in range(2))
    names = ("axial_force", "shear_force", "bending_moment")
    for i, name in enumerate(names):
        reading.compare_history(name, Linear(value[..., i], magnitude[..., i]))
    allowed = ROUNDING * magnitude.max(axis=0)
    moments = abs(film.time - reading.ds.extreme_time.values[..., None]).argmin(axis=-1)
    reading.compare("extreme_time", film.time[moments])
    for which in range(6):
        of, way = which // 2, (1, -1)[which % 2]
        for s, k in enumerate(moments[:, which]):
            if (way * value[:, s, of]).max() > way * value[k, s, of] + 2 * allowed[s, of]:
                reading.wrong.append(f"extreme_time: section {s} has its extreme {which} at another moment")
    for i, name in enumerate(names):
        expected = np.array([value[k, s, i] for s, row in enumerate(moments) for k in row]).reshape(moments.shape)
        reading.compare(f"extreme_{name}", expected, np.repeat(allowed[:, i, None], 6, axis=1))


def _section(
    model: Model, spec: Spec, twin: Twin, film: Film, ground: np.ndarray, section: Section
) -> tuple[np.ndarray, np.ndarray]:
    """N, Q, M (n_time, 3) that what is ahead exerts on what is behind, and the magnitudes of their terms."""
    mesh, system = model.system.mesh, model.system
    on_cut = np.zeros(len(mesh.nodes), dtype=bool)
    on_cut[section.nodes] = True

    def is_behind(nodes: np.ndarray) -> bool:
        return bool((mesh.nodes[nodes].mean(axis=0) - [section.x, section.y]) @ section.along < 0)

    node_dofs = (2 * section.nodes[:, None] + [0, 1]).ravel()
    elastic, mass = np.zeros((2, len(node_dofs), 2 * len(mesh.nodes)))
    place = np.full(2 * len(mesh.nodes), -1)
    place[node_dofs] = np.arange(len(node_dofs))
    material = materials(spec)
    for nodes, index, solid in zip(mesh.triangles, mesh.material, mesh.structure, strict=True):
        if not (solid and on_cut[nodes].any() and is_behind(nodes[:3])):
            continue
        of = material[index]
        k, m = reference.element(mesh.nodes[nodes], of.E, of.nu, of.rho)
        m = np.diag(m.sum(axis=1)) if system.lumped else m
        dofs = (2 * nodes[:, None] + [0, 1]).ravel()
        own = place[dofs] >= 0
        elastic[np.ix_(place[dofs[own]], dofs)] += k[own]
        mass[np.ix_(place[dofs[own]], dofs)] += np.kron(m, np.eye(2))[own]
    alpha, beta = model.rayleigh.alpha, model.rayleigh.beta
    base = np.tile(ground + np.array([0.0, gravity_of(spec)]), len(mesh.nodes))  # weight is the force of a base that rises
    parts = [_applied(elastic, film.u), _applied(beta * elastic, film.v), _applied(alpha * mass, film.v)]
    parts += [_applied(mass, film.a), _applied(mass, base)]
    parts.append(_joints_on(model, twin, film, node_dofs, [is_behind(joint[:2]) for joint in mesh.joints]))
    wet = replace(mesh, pressure_edges=mesh.pressure_edges[[is_behind(edge[:2]) for edge in mesh.pressure_edges]])
    water = reference.pressure_load(twin.whole, wet, water_on(mesh, spec))[_columns(twin, node_dofs)]
    pushed = np.repeat(water[None], len(film.u), axis=0)
    parts.append(Linear(-pushed, abs(pushed)))
    arm = mesh.nodes[section.nodes] - [section.x, section.y]
    inward = np.array([-section.along[1], section.along[0]])
    turn = np.column_stack([arm[:, 1], -arm[:, 0]])  # clockwise is what pulls at the inner face of what lies behind
    resultants = np.array([np.tile(section.along, len(arm)), np.tile(inward, len(arm)), turn.ravel()])
    value = sum(part.value for part in parts) @ resultants.T
    return value, sum(part.magnitude for part in parts) @ abs(resultants).T


def _joints_on(model: Model, twin: Twin, film: Film, node_dofs: np.ndarray, behind: list[bool]) -> Linear:
    """What the joint elements behind a cut bring to its nodes."""
    whole, points = twin.whole, model.system.points
    a_joint = len(whole.area) // len(behind)
    share = whole.area / points.area[twin.point] * np.repeat(behind, a_joint)
    force = ((film.force + film.damped)[:, twin.point] * share[:, None]).reshape(len(film.u), -1)
    return _applied(whole.B.toarray()[:, _columns(twin, node_dofs)].T, force)


def _columns(twin: Twin, dofs: np.ndarray) -> np.ndarray:
    """The reference's number of degrees of freedom that are free, as the structure's are."""
    return np.searchsorted(twin.whole.owner, dofs)


# ---- cases that follow from others ----


def _followers_misread(study: Study, ds: xr.Dataset, case: int) -> Iterator[str]:
    """Cases that follow from this one have its loads times one factor, and its response times that, by the units of each."""
    of = _case(study, ds, case)
    for other in study.scaling.followers.get(case, ()):
        follower = _case(study, ds, other)
        reading = _Reading(follower, study.cases[other].output.every)
        _read_base(reading, study, study.cases[other], study.ground(other))
        yield from (f"case {other}: {line}" for line in reading.wrong)
        factor, loads = float(follower.scaled_by), []
        for each in (case, other):
            spec = study.cases[each]
            loads.append([spec.pressure.p0, gravity_of(spec), *study.ground(each).ravel()])
        if int(follower.solved_as) != case + 1 or not np.allclose(np.multiply(loads[0], factor), loads[1], rtol=1e-12, atol=0):
            yield f"case {other}: its loads are not those of case {case} times {factor:g}"
        for name in SCHEMA.keys() - {"solved_as", "scaled_by", "uplift_over_weight", "reason"}:
            unit = SCHEMA[name].unit
            stays = unit in ("", "1", "s", "Hz") or name == "opened_length"  # of the joint, as it lies
            times = factor ** (0 if stays else 2 if unit.startswith("J") else 1)
            if not np.allclose(
                follower[name], times * of[name], rtol=1e-6 if SCHEMA[name].single else 1e-12, atol=0, equal_nan=True
            ):
                yield f"case {other}: {name} is not that of case {case} times {times:g}"
