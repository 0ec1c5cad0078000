"""What `check` says: the size of what would run, and warnings that come when they should and only then."""

import re

import numpy as np
import pytest

from engine import Spec, build_model
from engine.spec import Box, Domain, MeshOptions, Pressure
from studies import load_study, run_study, shipped_studies
from studies.advice import (
    MOST_BYTES,
    SECONDS_PER_STEP_AND_DOF,
    SECONDS_PER_STEP_AND_POINTS,
    advise,
    bending_bound,
    in_bytes,
    results_bytes,
    strip_bending,
)

from .conftest import COARSE, study_of

FINE_WALL = (
    "[mesh]\norder = 1\ncorner_levels = 0\nwall_elements = 4\nroof_elements = 16\nside_elements = 12\n"
    "first = '3 m'\ngrowth = 2.0\nlargest_width = '5 m'\n"
)
QUIET = '[pressure]\np0 = 0\n[time]\ndt = "5 ms"\nduration = "1 s"\n' + FINE_WALL + "largest_height = '1 m'\n"
"""Nothing to warn of: no uplift, ten steps a period and more, four elements through the wall, low elements."""

SIX_NODES = QUIET.replace("order = 1", "order = 2").replace("wall_elements = 4", "wall_elements = 1")
"""The same with one six-node triangle through the wall."""


def warnings_of(text, workers=1):
    return advise(study_of(text), workers).warnings


def facts_of(text, workers=1):
    return dict(advise(study_of(text), workers).facts)


def test_work_is_that_of_the_solved_cases():
    """Nine cases of 200 steps; five ratios without self-weight, which share a batch."""
    text = QUIET + '[sweep]\np0 = ["1 MPa", "2 MPa", "4 MPa"]\nscale = [1, 2, 4]\n'
    assert facts_of(text)["cases"].startswith("9 in 1 batch, 1,800 case-steps")
    assert facts_of(text + "[gravity]\nself_weight = false")["cases"].startswith("9 in 1 batch, 1,000 case-steps")


# bending bound ---------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("elements", "along", "bound"),
    [
        (1, 2.0, 7.874999999999999),
        (2, 2.0, 5.8687499999999995),
        (4, 1.0, 2.2171874999999996),
        (4, 0.25, 1.2328125),
        (16, 0.5, 1.27294921875),
    ],
)
def test_bending_bound_is_the_closed_form(elements, along, bound):
    """Verification case 01: n elements through the wall H, cells of length a; nu = 0.3. 7.9 and 1.23 in its text."""
    outer = 8 * along * 0.5 + 1  # H = 0.5 m; 8 elements along width and height alike
    box = Box(width=outer, height=outer, wall=0.5, nu=0.3)
    mesh = MeshOptions(order=1, wall_elements=elements, roof_elements=8, side_elements=8)
    spec = Spec(box=box, mesh=mesh, domain=Domain(width=40, depth=40))
    assert bending_bound(spec) == pytest.approx(bound, rel=1e-14)


def test_bending_bound_of_eight_elements():
    """Verification case 01: n = 8, a/H = 0.125 gives 1.06."""
    spec = Spec(box=Box(width=5, height=5), mesh=MeshOptions(order=1, wall_elements=8, roof_elements=64, side_elements=64))
    assert round(bending_bound(spec), 2) == 1.06


def test_bending_bound_is_that_of_the_longer_elements():
    """Of 1 m along the roof and 1.5 m along the side, with a wall of 0.5 m, a/H = 3 counts."""
    (spec,) = study_of(COARSE).cases
    assert bending_bound(spec) == pytest.approx(1 + 2.675 + 1.5 * 0.7 * 9, rel=1e-14)


@pytest.mark.parametrize("elements", [1, 2, 4])
def test_six_node_triangles_bend_right(elements):
    """A field of second degree holds the bending of a beam, however few and long the elements (verification case 01)."""
    assert bending_bound(Spec(mesh=MeshOptions(order=2, wall_elements=elements, roof_elements=2, side_elements=2))) == 1


# facts -----------------------------------------------------------------------------------------------------------------------


def test_facts_are_those_of_the_model():
    text = COARSE + '[time]\ndt = "10 ms"\nduration = "0.4 s"\n[sweep]\np0 = [0, "2 MPa"]\ndamping_ratio = [0.02, 0.05, 0.1]\n'
    facts = facts_of(text)
    model = build_model(study_of(text).cases[0])
    assert facts["cases"].startswith("6 in 3 batches, 240 case-steps")
    assert facts["axes"] == "p0 (2), damping_ratio (3)"
    assert facts["mesh"] == "32 structure + 20 joint + 132 ground elements"
    assert facts["unknowns"] == f"{model.system.n_dof} degrees of freedom, 24 joint points"
    assert facts["frequencies"].startswith(f"{model.frequencies[0]:.4g}, {model.frequencies[1]:.4g}, ")
    assert facts["bending"] == "three-node triangles: walls at most 13.1 times too stiff"
    assert facts["uplift / weight"] == "0 to 14.6"


def test_facts_of_six_node_triangles_are_those_of_the_model():
    """As many triangles and joints as with three nodes; a joint of six nodes has three points, two shared with the next."""
    text = COARSE.replace("order = 1", "order = 2")
    facts, system = facts_of(text), build_model(study_of(text).cases[0]).system
    assert facts["mesh"] == "32 structure + 20 joint + 132 ground elements"
    assert facts["unknowns"] == f"{system.n_dof} degrees of freedom, {len(system.points)} joint points"
    assert len(system.points) == 24 + 20
    assert facts["bending"] == "six-node triangles: right where a wall bends, see docs/mesh.md for the corners"


@pytest.mark.parametrize("orders", ["[2, 1]", "[1, 2]"])
def test_of_several_orders_the_three_node_triangles_are_told_of(orders):
    facts = facts_of(COARSE + f"[sweep]\nmesh.order = {orders}\n")
    assert facts["bending"] == "three-node triangles: walls at most 13.1 times too stiff"
    assert facts["cases"].startswith("2 in 2 batches")
    assert " to " in facts["unknowns"]


def test_the_default_is_six_node_triangles():
    assert facts_of("")["bending"].startswith("six-node triangles")


def test_one_case_is_one_batch_without_axes():
    facts = facts_of(COARSE)
    assert facts["cases"].startswith("1 in 1 batch")
    assert facts["axes"] == "none"
    assert facts["uplift / weight"] == "14.6"


def test_uplift_is_told_over_all_cases_of_the_study():
    """More pressures than a batch has lanes: the largest are in the second batch."""
    text = COARSE + '[sweep]\np0 = { from = 0, to = "2 MPa", num = 21 }\n'
    assert facts_of(text)["uplift / weight"] == "0 to 14.6"


MESHES = (
    '[time]\ndt = "10 ms"\nduration = "1 s"\n[gravity]\nself_weight = false\n[sweep]\ndomain_width = ["14 m", "20 m", "40 m"]\n'
    'sides = ["tied", "shear", "roller", "fixed"]\n'
)
"""Twelve batches, each of its own mesh or its own sides."""


def test_counts_of_every_batch_are_those_of_its_model():
    """The unknowns are those of the model whatever holds its sides; the counts are told from the least to the most."""
    study = study_of(COARSE + MESHES)
    systems = [build_model(spec).system for spec in study.cases]
    facts = facts_of(COARSE + MESHES)
    unknowns = [system.n_dof for system in systems]
    ground = [int((~system.mesh.structure).sum()) for system in systems]
    assert len(set(unknowns)) == 4  # 14 m and 20 m have as many columns, and sides hold as many nodes but where they are fixed
    assert facts["unknowns"].startswith(f"{min(unknowns)} to {max(unknowns)} degrees of freedom")
    assert facts["mesh"] == f"32 structure + 20 joint + {min(ground)} to {max(ground)} ground elements"
    for spec, n in zip(study.cases, unknowns, strict=True):
        width, sides = spec.domain.width, spec.supports.sides
        one = f'[gravity]\nself_weight = false\n[domain]\nwidth = "{width} m"\n[supports]\nsides = "{sides}"\n'
        assert facts_of(COARSE + one)["unknowns"].startswith(f"{n} degrees of freedom")


@pytest.mark.parametrize("workers", [1, 2, 3, 100])
def test_the_estimate_is_of_each_batch_and_the_longest_at_least(workers):
    """Every batch takes its unknowns, its joint points a case and its longest case; no workers beat the longest batch."""
    text = FINE_WALL + '[sweep]\nduration = ["20 s", "40 s", "100 s"]\np0 = [0, "1 MPa"]\n'
    system = build_model(study_of(text).cases[0]).system
    joint_solve = 2 * len(system.mesh.joints) ** 2 * SECONDS_PER_STEP_AND_POINTS
    each = [(system.n_dof * SECONDS_PER_STEP_AND_DOF + joint_solve) * duration / 0.005 for duration in (20, 40, 100)]
    expected = max(max(each), sum(each) / workers)
    assert facts_of(text, workers)["cases"].endswith(f"6 in 3 batches, 64,000 case-steps, about {expected:.0f} s")


@pytest.mark.parametrize(
    "extra",
    [
        "",
        "[output]\nsections = 33\n",
        '[output.points]\nX = ["5 m", "-9 m"]\nY = ["5 m", "-12 m"]\n',
        '[joint]\nquadrature = "one-point"\n',
        '[sweep]\ndt = ["10 ms", "5 ms"]\nevery = [1, 2]\n',
        "[sweep]\nmesh.order = [2, 1]\n",
    ],
    ids=["one case", "many sections", "further points", "one-point joints", "steps", "orders"],
)
def test_the_memory_of_the_results_is_about_that_of_the_dataset(extra):
    """The histories are counted, which outweigh all else where there are hundreds of steps."""
    text = COARSE + '[time]\ndt = "10 ms"\nduration = "4 s"\n' + extra
    study = study_of(text)
    model = build_model(study.cases[0])
    assert facts_of(text)["results"] == f"about {in_bytes(results_bytes(study, model))} in memory"
    assert results_bytes(study, model) == pytest.approx(run_study(study, workers=1).nbytes, rel=0.2)


@pytest.mark.parametrize(
    ("count", "text"), [(5.0, "0.005 kB"), (83_000, "83 kB"), (996_000, "1000 kB"), (1.26e6, "1.3 MB"), (3.4e10, "34 GB")]
)
def test_bytes_in_words(count, text):
    assert in_bytes(count) == text


# warnings --------------------------------------------------------------------------------------------------------------------


def test_nothing_to_warn_of():
    assert warnings_of(QUIET) == []


def test_of_six_node_triangles_nothing_is_warned_of():
    assert warnings_of(SIX_NODES) == []


def test_the_default_mesh_is_warned_of_for_its_load_alone():
    """The pressure of the source lifts the box and bends its walls; the mesh itself is the recommended one."""
    about = ("the net uplift of the pressure reaches 14.6", "pressure.p0 = 2 MPa bends the walls")
    found = warnings_of("")
    assert len(found) == len(about)
    assert all(line.startswith(begin) for line, begin in zip(found, about, strict=True))
    assert warnings_of("[pressure]\np0 = 0\n") == []


def test_long_steps_are_warned_of():
    (warning,) = warnings_of(QUIET.replace('"5 ms"', '"20 ms"'))
    frequency = build_model(study_of(QUIET).cases[0]).frequencies[0]
    assert warning.startswith(f"time.dt = 0.02 s gives {50 / frequency:.1f} steps a period of the first mode")


def test_the_longest_step_of_a_sweep_counts():
    found = warnings_of(QUIET + '[sweep]\ndt = ["2 ms", "20 ms"]\n')
    assert [warning.split(" gives")[0] for warning in found] == ["time.dt = 0.02 s"]


@pytest.mark.parametrize("depth", [14, 15, 17, 20, 23])
def test_the_step_that_is_advised_is_short_enough(depth):
    """Following the advice silences it, whatever its last digit."""
    text = COARSE + f'[domain]\ndepth = "{depth} m"\n'
    (warning,) = [w for w in warnings_of(text + '[time]\ndt = "50 ms"\n') if "time.dt" in w]
    advised = re.search(r"take (\S+) s or less", warning)[1]
    assert not [w for w in warnings_of(text + f'[time]\ndt = "{advised} s"\n') if "time.dt" in w]


def test_few_elements_through_the_wall_are_warned_of():
    (warning,) = warnings_of(QUIET.replace("wall_elements = 4", "wall_elements = 1"))
    bound = 1 + 2.675 + 1.5 * 0.7 * 0.5**2  # elements of 0.25 m along a wall of 0.5 m
    assert warning == (
        f"the walls may be {bound:.1f} times too stiff in bending: read racking and wall stress as lower bounds, "
        "or take mesh.order = 2"
    )


def test_following_the_advice_on_the_walls_silences_it():
    assert warnings_of(QUIET.replace("wall_elements = 4", "wall_elements = 1").replace("order = 1", "order = 2")) == []


@pytest.mark.parametrize("orders", ["[2, 1]", "[1, 2]"])
def test_of_several_orders_the_walls_of_three_node_triangles_are_warned_of(orders):
    (warning,) = warnings_of(SIX_NODES.replace("order = 2\n", "") + f"[sweep]\nmesh.order = {orders}\n")
    assert warning.startswith("the walls may be 3.9 times too stiff")


def test_the_coarsest_wall_of_a_sweep_counts():
    text = QUIET.replace("wall_elements = 4\n", "") + "[sweep]\nwall_elements = [4, 1]\n"
    assert [warning.split(" too stiff")[0] for warning in warnings_of(text)] == ["the walls may be 3.9 times"]


def test_a_bound_under_one_and_a_half_is_not():
    assert bending_bound(study_of(QUIET).cases[0]) == pytest.approx(1 + 2.675 / 16 + 1.5 * 0.7 * 0.5**2, rel=1e-14)
    assert warnings_of(QUIET) == []


@pytest.mark.parametrize(
    ("p0", "expected"),
    [
        ('p0 = "0.13 MPa"', []),
        ('p0 = "0.15 MPa"', ["the net uplift of the pressure reaches 1.09 times the box's weight: it leaves its floor"]),
    ],
)
def test_uplift_above_the_weight_is_warned_of(p0, expected):
    """Uplift equals weight at p0 = 0.137 MPa (DESIGN section 1: near 0.14 MPa)."""
    assert warnings_of(QUIET.replace("p0 = 0", p0)) == expected


@pytest.mark.parametrize("num", [2, 16, 40])
def test_uplift_of_any_case_of_a_sweep_is_warned_of(num):
    (warning,) = warnings_of(QUIET + f'[sweep]\np0 = {{ from = 0, to = "0.2 MPa", num = {num} }}\n')
    assert "reaches 1.46 times" in warning


def layer(bottom, speed):
    return f'[[layer]]\nbottom = "{bottom} m"\nnu = 0.25\nVs = "{speed} m/s"\ndensity = "2 t/m**3"\nfriction = 0.3\n'


def high(text, index):
    """Largest height [m] of the elements of a layer."""
    mesh = build_model(study_of(text).cases[0]).system.mesh
    return np.ptp(mesh.nodes[mesh.triangles[mesh.material == index]][:, :, 1], axis=1).max()


def short_waves(text):
    return [w for w in warnings_of(text) if "shear waves" in w]


def test_high_elements_in_soft_ground_are_warned_of():
    """25 Hz is what a record of 10 ms carries well; a sixth of the wave in 50 m/s is then 0.33 m, the elements are 1 m high."""
    text = QUIET + layer(4, 50) + layer(14, 800)
    size = high(text, 0)
    assert short_waves(text) == [
        f"elements are too high for shear waves of the motion's 25 Hz: layer 1 ({size:.3g} m high) carries up to "
        f"{50 / 6 / size:.3g} Hz well; lower mesh.largest_height"
    ]
    assert not short_waves(QUIET + layer(4, 400) + layer(14, 800))


def test_six_node_triangles_carry_waves_of_half_the_length():
    """The nodes are half an element apart: of 50 m/s and 25 Hz two thirds of a metre would do."""
    text = SIX_NODES + layer(4, 50) + layer(14, 800)
    size = high(text, 0)
    (line,) = short_waves(text)
    assert f"layer 1 ({size:.3g} m high) carries up to {2 * 50 / 6 / size:.3g} Hz well" in line
    between = 6 * 25 * size * 0.75  # m/s: too slow for three nodes, fast enough for six
    assert short_waves(QUIET + layer(4, between) + layer(14, 800))
    assert not short_waves(SIX_NODES + layer(4, between) + layer(14, 800))


def test_all_layers_with_high_elements_are_in_one_line():
    text = QUIET + layer(4, 50) + layer(9, 800) + layer(14, 100)
    (line,) = short_waves(text)
    for i, speed in ((0, 50), (2, 100)):
        assert f"layer {i + 1} ({high(text, i):.3g} m high) carries up to {speed / 6 / high(text, i):.3g} Hz well" in line
    assert "layer 2" not in line


def test_the_softest_ground_of_a_sweep_is_warned_of():
    """Not of the first case, nor of every case."""
    text = QUIET + layer(4, 400) + layer(14, 800)
    (line,) = short_waves(text + '[sweep]\nlayer.1.Vs = ["400 m/s", "50 m/s", "60 m/s"]\n')
    assert f"layer 1 ({high(text, 0):.3g} m high) carries up to {50 / 6 / high(text, 0):.3g} Hz well" in line
    assert line.count("layer 1") == 1


@pytest.mark.parametrize(
    ("motion", "frequency"),
    [
        ('record = "ricker"\n[ricker]\nfrequency = "7 Hz"\n', "21"),
        ('record = "ricker"\n[ricker]\nfrequency = "20 Hz"\n', "50"),  # a quarter of the step's rate
        ('record = "synthetic"\n[synthetic]\nstep = "20 ms"\n', "12.5"),
        ('record = "none"\nvertical_record = "synthetic"\n', "25"),
    ],
)
def test_the_highest_frequency_is_that_of_the_motion_or_of_the_step(motion, frequency):
    """At three times its own a Ricker wavelet has a fiftieth part of its spectrum's peak: 9 exp(-8) = 0.003."""
    (line,) = short_waves(QUIET + layer(4, 20) + layer(14, 800) + f"[motion]\n{motion}")
    assert f"of the motion's {frequency} Hz: layer 1" in line


def test_without_a_motion_no_wave_is_short():
    assert warnings_of(QUIET + layer(4, 20) + layer(14, 800) + '[motion]\nrecord = "none"\n') == []


# pressure and motion -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("sign", [1, -1])
def test_strip_bending_is_that_of_clamped_strips(sign):
    """M = p L²/12 at the ends of a clamped strip, W = t²/6; L from axis to axis; p at the depth of roof, floor and mid-height."""
    p0, reference, wall = sign * 1.5e6, 10.0, 0.4
    box = Box(width=6, height=3, wall=wall, depth=2)
    stresses = []
    for depth, span in ((2.0, 5.6), (5.0, 5.6), (3.5, 2.6)):
        pressure = abs(p0) * depth / reference
        stresses.append(pressure * span**2 / 12 / (wall**2 / 6))
    spec = Spec(box=box, pressure=Pressure(p0=p0, reference_height=reference))
    assert strip_bending(spec) == pytest.approx(max(stresses), rel=1e-14)
    assert strip_bending(spec) == pytest.approx(stresses[1], rel=1e-14)  # the floor: deepest and widest
    tall = Spec(
        box=Box(width=2, height=6, depth=2), domain=Domain(depth=20), pressure=Pressure(p0=p0, reference_height=reference)
    )
    assert strip_bending(tall) == pytest.approx(1.5e6 * 0.5 * 5.5**2 / 12 / (0.5**2 / 6), rel=1e-14)  # the walls: longest


@pytest.mark.parametrize(("p0", "warned"), [("1.7 MPa", False), ("1.8 MPa", True), ("-1.8 MPa", True)])
def test_pressure_beyond_what_concrete_bears_is_warned_of(p0, warned):
    """40 MPa at p0 = 40 · 2 (0.5/4.5)² · 14/8 = 1.73 MPa: the floor at 8 m spans 4.5 m with 0.5 m."""
    found = [w for w in warnings_of(QUIET.replace("p0 = 0", f'p0 = "{p0}"')) if "concrete" in w]
    stress = 1.8e6 * 8 / 14 * (4.5 / 0.5) ** 2 / 2
    expected = (
        f"pressure.p0 = {p0} bends the walls, taken as clamped strips, to {1e-6 * stress:.0f} MPa; "
        "strong concrete bears 40 MPa in compression and a tenth of that in tension"
    )
    assert found == ([expected] if warned else [])


def test_the_worst_pressure_of_a_sweep_is_named():
    (line,) = [
        w for w in warnings_of(QUIET + '[sweep]\np0 = [0, "4 MPa", "2 MPa"]\nwall = ["0.6 m", "0.5 m"]\n') if "concrete" in w
    ]
    assert line.startswith("pressure.p0 = 4 MPa bends the walls, taken as clamped strips, to 93 MPa")


STRONG = "the motion reaches"


@pytest.mark.parametrize(
    ("motion", "expected"),
    [
        ('peak = "19.6 m/s**2"\nrecord = "synthetic"', []),
        ('peak = "19.7 m/s**2"\nrecord = "synthetic"', [f"{STRONG} 19.7 m/s² = 2 g; hardly any record on firm ground does"]),
        (
            'peak = "2 m/s**2"\nscale = 12\nrecord = "ricker"',
            [f"{STRONG} 24 m/s² = 2.4 g; hardly any record on firm ground does"],
        ),
        (
            'peak = "2 m/s**2"\nrecord = "none"\nvertical_record = "ricker"\nvertical_peak = "3 g_0"',
            [f"{STRONG} 29.4 m/s² = 3 g; "],
        ),
        ('record = "none"\nscale = 100', []),
    ],
)
def test_motion_stronger_than_two_g_is_warned_of(motion, expected):
    found = warnings_of(QUIET + f"[motion]\n{motion}\n")
    assert len(found) == len(expected)
    assert all(line.startswith(begin) for line, begin in zip(found, expected, strict=True))


def test_record_scaled_up_more_than_four_times_is_warned_of():
    """The factor is that of the peak to the record's own."""
    record = study_of(QUIET).motions["ridgecrest-2019-clc-360.AT2"]
    scaled = (
        '[time]\nduration = "{}"\ndt = "5 ms"\n[pressure]\np0 = 0\n'
        + FINE_WALL
        + 'largest_height = "1 m"\n[motion]\npeak = "{} m/s**2"\n'
    )
    assert warnings_of(scaled.format("30 s", 3.9 * record.peak)) == []
    found = warnings_of(scaled.format("30 s", 4.1 * record.peak))
    assert found == [
        f"{STRONG} 20.5 m/s² = 2.1 g; hardly any record on firm ground does",
        "ridgecrest-2019-clc-360.AT2 is scaled up 4.1 times; so strong an earthquake lasts longer and has other frequencies",
    ]


def test_the_strongest_motion_of_a_sweep_is_warned_of():
    found = warnings_of(QUIET + "[sweep]\nscale = [1, 20, 2]\n")
    assert [line.split(" m/s²")[0] for line in found if line.startswith(STRONG)] == [f"{STRONG} 34.2"]
    assert sum("is scaled up" in line for line in found) == 1


# what has no effect ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "warning"),
    [
        ("[sweep]\nseed = [1, 2]\n", 'synthetic.seed is swept without effect: no motion.record = "synthetic"'),
        ('[sweep]\nricker.frequency = ["2 Hz"]\n', 'ricker.frequency is swept without effect: no motion.record = "ricker"'),
        ('[motion]\nrecord = "none"\n[sweep]\nscale = [1, 2]\n', "motion.scale is swept without effect: there is no motion"),
        ('[motion]\nvertical_peak = "1 m/s**2"\n', 'motion.vertical_peak has no effect: motion.vertical_record = "none"'),
        (
            '[motion]\nrecord = "synthetic"\nrecord_dt = "1 s"\n',
            "motion.record_dt and motion.record_unit have no effect: no record is read",
        ),
        (
            '[joint]\nthickness_ratio = 0.1\n[sweep]\njoint.thickness = ["5 cm", "1 cm"]\n',
            "joint.thickness is swept without effect: joint.thickness_ratio replaces it",
        ),
    ],
)
def test_what_has_no_effect_is_warned_of(text, warning):
    assert [w for w in warnings_of(QUIET + text) if "effect" in w] == [warning]


@pytest.mark.parametrize(
    "text",
    [
        '[motion]\nrecord = "synthetic"\n[sweep]\nseed = [1, 2]\n',
        '[motion]\nvertical_record = "synthetic"\nvertical_peak = "1 m/s**2"\n[sweep]\nseed = [1, 2]\n',
        '[sweep]\nrecord = ["none", "ricker"]\nricker.frequency = ["2 Hz", "3 Hz"]\nscale = [1, 2]\n',
        '[sweep]\njoint.thickness = ["5 cm", "1 cm"]\n',
        "[sweep]\nthickness_ratio = [0.1, 0.2]\n",
    ],
)
def test_what_has_an_effect_is_not(text):
    assert not [w for w in warnings_of(QUIET + text) if "effect" in w]


def test_results_that_hardly_fit_in_memory_are_warned_of():
    text = QUIET.replace('"1 s"', '"100 s"') + "[output]\nevery = 1\n[sweep]\np0 = { from = 0, to = '1 kPa', num = 1000 }\n"
    study = study_of(text)
    needed = results_bytes(study, build_model(study.cases[0]))
    assert needed > MOST_BYTES
    assert (
        f"the results take about {in_bytes(needed)}, on disk and in memory where they are drawn; raise output.every"
        in advise(study, 1).warnings
    )
    assert not [w for w in warnings_of(text.replace("num = 1000", "num = 100")) if "memory" in w]


# the shipped studies ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", sorted(set(shipped_studies()) - {"domain_size"}))
def test_of_the_shipped_studies_only_what_the_source_prescribes_is_warned_of(name):
    """The source's pressure, its wall and step where its mesh is meant; nothing of the motion, the memory or idle fields."""
    about = ("the net uplift", "pressure.p0 =", *(["the walls may be", "time.dt = 0.02 s gives 2.7"] if name == "paper" else []))
    warnings = advise(load_study(name), 2).warnings
    assert len(warnings) == len(about)
    assert all(line.startswith(about) for line in warnings)
