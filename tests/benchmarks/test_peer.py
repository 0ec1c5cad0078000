"""OpenSees' model is ours: contacts in sign and orientation, and histories of displacement where its contact follows (D3)."""

from dataclasses import replace
from importlib.machinery import ModuleSpec

import numpy as np
import pytest

from benchmarks import peer
from benchmarks.models import MESHES, OPENING, SLIDING, STICKING, Loading, shaking, spec_of
from benchmarks.peer import HELPED, PLAIN, REMEMBERING, SOLVERS, Case, Contact, add_contacts, march, opensees
from benchmarks.ratio import agreement
from engine import JointMaterial, Material, Response, System, build_model, build_system, simulate_cases
from engine.kernels.joint import OPEN, SLIP_BACKWARD, SLIP_FORWARD, STICK, respond
from engine.spec import Joint, MeshOptions

N_STEP = 60
GOAL = 1e-6
"""Of the peak. What is seen is 1e-8 or less: OpenSees stops iterating at 1e-8 of the loads."""


@pytest.fixture(scope="module")
def ops():
    found = opensees()
    if found is None:
        pytest.skip("OpenSeesPy is not installed")
    yield found
    found.wipe()


@pytest.fixture
def inclined(block_mesh) -> System:
    """Two joints between blocks, at 30° so that no axis of the joint is one of the plane."""
    angle = np.deg2rad(30)
    turned = block_mesh.nodes @ np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    mesh = replace(block_mesh, nodes=turned)
    return build_system(mesh, [Material(2e3, 0.25, 1.8)] * 2, [JointMaterial(4e4, 2e4, 0.4)], lumped=True)


GAPS = np.array([[-0.01, 0.002], [-0.01, 0.02], [-0.01, -0.02], [0.01, 0.02], [-0.02, -0.01]])
"""Normal and tangential: sticking, slipping forward and backward, open, sticking."""


@pytest.mark.parametrize("gap", GAPS)
def test_plain_contact_has_our_gap_forces_and_orientation(ops, inclined, gap):
    """The element's forces on (structure, ground) under a given gap are those of (D2) and (D3), for every point of a joint."""
    law = inclined.joint_law()
    ops.wipe()
    ops.model("basic", "-ndm", 2, "-ndf", 2)
    for node, place in enumerate(inclined.mesh.nodes.tolist()):
        ops.node(node, *place)
    add_contacts(ops, inclined, law, PLAIN.element)
    first = len(inclined.mesh.triangles)
    for point, (normal, k_n, k_s, mu) in enumerate(zip(inclined.points.normal, *law, strict=True)):
        tangent = np.array([normal[1], -normal[0]])
        structure, _ = ops.eleNodes(first + point)
        for direction, value in enumerate((gap @ [normal, tangent]).tolist(), start=1):
            ops.setNodeDisp(structure, direction, value, "-commit")
        _, pressing, shear = respond(*gap, 0.0, k_n, k_s, mu)
        expected = pressing * normal + shear * tangent
        # OpenSees takes the gap as a difference of places: their rounding, 2e-16, over a gap of 1e-2
        np.testing.assert_allclose(ops.eleResponse(first + point, "force"), [*expected, *-expected], rtol=1e-12, atol=1e-10)


def test_gaps_of_the_orientation_test_are_of_every_state(inclined):
    k_n, k_s, mu = (part[0] for part in inclined.joint_law())
    assert {respond(*gap, 0.0, k_n, k_s, mu)[0] for gap in GAPS} == {OPEN, STICK, SLIP_FORWARD, SLIP_BACKWARD}


SPRING = 0.1
"""Stiffness of the spring that holds the sliding point, over k_s."""


def crept(ops, contact: Contact, system: System) -> float:
    """How far a point held by a spring goes on sliding under a load that no longer changes, over its first slide."""
    k_n, k_s, mu = (part[:1] for part in system.joint_law())
    points = system.points
    one = replace(points, nodes=points.nodes[:1], shape=points.shape[:1], normal=points.normal[:1], area=points.area[:1])
    below, above = one.nodes[0][[0, 3]].tolist()
    normal = one.normal[0]
    tangent = np.array([normal[1], -normal[0]])
    ops.wipe()
    ops.model("basic", "-ndm", 2, "-ndf", 2)
    for node in (below, above):
        ops.node(node, *points.place[0].tolist())
    ops.fix(below, 1, 1)
    ops.uniaxialMaterial("Elastic", 1, SPRING * float(k_s[0]))
    ops.element("zeroLength", 1, below, above, "-mat", 1, 1, "-dir", 1, 2)
    add_contacts(ops, replace(system, points=one), (k_n, k_s, mu), contact.element)
    ops.timeSeries("Constant", 1)
    ops.pattern("Plain", 1, 1)
    ops.load(above, *(-PRESSED * normal + DRAGGED * tangent).tolist())
    ops.constraints("Plain")
    ops.numberer("Plain")
    ops.system("FullGeneral")
    ops.test("NormUnbalance", 1e-8, 50)
    ops.algorithm(contact.algorithms[0])
    ops.integrator("LoadControl", 1.0)
    ops.analysis("Static", "-noWarnings")
    places = []
    for _ in range(3):
        assert ops.analyze(1) == 0
        places.append(np.array([ops.nodeDisp(above, 1), ops.nodeDisp(above, 2)]) @ tangent)
    return (places[-1] - places[0]) / places[0]


PRESSED, DRAGGED = 100.0, 80.0
"""Forces [N] on that point; friction carries less than half of the second."""


def test_plain_contact_forgets_its_shear_after_a_slide_and_the_other_does_not(ops, inclined):
    """Why sliding histories are compared with the other element: under a constant load nothing may move any more.

    The forgetful point starts its second step without shear, and spring and stiffness k_s carry together what the spring had.
    """
    k_n, k_s, mu = (part[0] for part in inclined.joint_law())
    limit = mu * PRESSED * k_n / (k_n + SPRING * k_s)  # the spring carries a part of the pressing force
    first = (DRAGGED - limit) / (SPRING * k_s)
    second = (DRAGGED + k_s * first) / ((1 + SPRING) * k_s)
    tolerance = 1e-9  # the test of convergence, 1e-8 N, over forces of 40 N and more
    assert crept(ops, PLAIN, inclined) == pytest.approx(second / first - 1, rel=tolerance)
    assert abs(crept(ops, REMEMBERING, inclined)) < tolerance


def both(loading: Loading, contact: Contact, solver: str = SOLVERS[0], vertical: float = 0.0):
    """OpenSees' march and our response, of the paper mesh; the vertical motion is so many times the horizontal one."""
    spec = spec_of(MESHES["paper"], loading, 2.0)
    model = build_model(spec)
    motion = shaking(spec)[: N_STEP + 1]
    motion[:, 1] = vertical * motion[:, 0]
    return march(Case(model, spec, motion), contact, solver), simulate_cases(model, [spec], [motion])


def difference(theirs, response: Response) -> float:
    return agreement(theirs.displacement, response.recorder.displacement(response.values)[0])


@pytest.mark.parametrize("solver", SOLVERS)
def test_histories_agree_where_points_stick(ops, solver):
    theirs, ours = both(STICKING, PLAIN, solver, vertical=0.5)
    assert theirs.n_done == N_STEP
    assert (theirs.iterations == 1).all()  # linear
    assert (ours.fractions[0, :, 1] == 0).all()
    assert difference(theirs, ours) < GOAL


def test_histories_agree_where_points_open_and_close_without_friction(ops):
    theirs, ours = both(OPENING, PLAIN)
    assert theirs.n_done == N_STEP
    opened = np.diff(ours.fractions[0, :, 0])
    assert opened.min() < 0 < opened.max()
    assert difference(theirs, ours) < GOAL


def test_histories_agree_where_points_slide(ops):
    theirs, ours = both(SLIDING, REMEMBERING)
    assert theirs.n_done == N_STEP
    assert ours.fractions[0, 1:, 1].max() > 0.1
    assert difference(theirs, ours) < GOAL


def test_plain_contact_misses_the_sliding_history(ops):
    theirs, ours = both(SLIDING, PLAIN)
    assert theirs.n_done == N_STEP
    assert difference(theirs, ours) > 1e-3


def test_what_does_not_converge_ends_the_march(ops):
    """Lifted off its floor, Newton's method alone already fails under the standing loads; ours goes through."""
    lifted = replace(SLIDING, p0=2e5)
    theirs, ours = both(lifted, PLAIN)
    assert (theirs.n_done, theirs.helped.tolist()) == (-1, [0])
    assert ours.status[0] == 0
    helped, _ = both(lifted, HELPED)
    assert helped.n_done > 0
    assert helped.helped[0] == 0


@pytest.mark.parametrize(
    ("mesh", "joint"),
    [(MESHES["T6"], Joint()), (MESHES["paper"], Joint(quadrature="one-point")), (MeshOptions(order=1), Joint())],
)
def test_models_that_opensees_does_not_have_are_refused(ops, mesh, joint):
    spec = spec_of(mesh, STICKING, 1.0).model_copy(update={"joint": joint})
    with pytest.raises(ValueError, match="joint is nodal, without damping, and its mass lumped"):
        march(Case(build_model(spec), spec, shaking(spec)), PLAIN, SOLVERS[0])


def test_motion_must_start_from_zero(ops):
    spec = spec_of(MESHES["paper"], STICKING, 1.0)
    with pytest.raises(ValueError, match="must start from zero"):
        march(Case(build_model(spec), spec, shaking(spec) + 1.0), PLAIN, SOLVERS[0])


def test_without_opensees_a_march_says_so(monkeypatch):
    monkeypatch.setattr("benchmarks.peer.opensees", lambda: None)
    spec = spec_of(MESHES["paper"], STICKING, 1.0)
    with pytest.raises(RuntimeError, match="openseespy is not installed"):
        march(Case(build_model(spec), spec, shaking(spec)), PLAIN, SOLVERS[0])


@pytest.mark.parametrize("error", [ModuleNotFoundError, RuntimeError])
def test_a_package_that_is_missing_or_cannot_be_loaded_is_none(monkeypatch, error):
    def refused(name: str) -> None:
        raise error(name)

    monkeypatch.setattr(peer, "import_module", refused)
    monkeypatch.setattr(peer, "find_spec", lambda name: None)
    assert peer._loaded.__wrapped__()[0] is None


def test_a_wheel_for_another_processor_has_no_blas_to_load(monkeypatch, tmp_path):
    (tmp_path / "lib").mkdir()
    (tmp_path / "lib" / "libblas.so.3").write_bytes(b"of another processor")
    monkeypatch.setattr(peer, "find_spec", lambda name: ModuleSpec(name, None, origin=str(tmp_path / "__init__.py")))
    assert not peer._load_its_own_blas()
