"""What `check` says: the size of what would run, and warnings that come when they should and only then."""

import re

import numpy as np
import pytest

from engine import Spec, build_model
from engine.spec import Box, Domain, MeshOptions
from studies.advice import advise, bending_bound

from .conftest import COARSE, study_of

FINE_WALL = (
    "[mesh]\nwall_elements = 8\nroof_elements = 32\nside_elements = 24\nfirst = '3 m'\ngrowth = 2.0\nlargest_width = '5 m'\n"
)
QUIET = '[pressure]\np0 = 0\n[time]\ndt = "5 ms"\nduration = "1 s"\n' + FINE_WALL + "largest_height = '1 m'\n"
"""Nothing to warn of: no uplift, ten steps a period and more, eight elements through the wall, low elements."""


def warnings_of(text, workers=1):
    return advise(study_of(text), workers).warnings


def facts_of(text, workers=1):
    return dict(advise(study_of(text), workers).facts)


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
    mesh = MeshOptions(wall_elements=elements, roof_elements=8, side_elements=8)
    spec = Spec(box=box, mesh=mesh, domain=Domain(width=40, depth=40))
    assert bending_bound(spec) == pytest.approx(bound, rel=1e-14)


def test_bending_bound_of_eight_elements():
    """Verification case 01: n = 8, a/H = 0.125 gives 1.06."""
    spec = Spec(box=Box(width=5, height=5), mesh=MeshOptions(wall_elements=8, roof_elements=64, side_elements=64))
    assert round(bending_bound(spec), 2) == 1.06


def test_bending_bound_is_that_of_the_longer_elements():
    """Of 1 m along the roof and 1.5 m along the side, with a wall of 0.5 m, a/H = 3 counts."""
    (spec,) = study_of(COARSE).cases
    assert bending_bound(spec) == pytest.approx(1 + 2.675 + 1.5 * 0.7 * 9, rel=1e-14)


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
    assert facts["bending bound"].startswith("walls in T3 are at most 13.1")
    assert facts["uplift / weight"] == "0 to 14.6"


def test_one_case_is_one_batch_without_axes():
    facts = facts_of(COARSE)
    assert facts["cases"].startswith("1 in 1 batch")
    assert facts["axes"] == "none"
    assert facts["uplift / weight"] == "14.6"


def test_uplift_is_told_over_all_cases_of_the_study():
    """More pressures than a batch has lanes: the largest are in the second batch."""
    text = COARSE + '[sweep]\np0 = { from = 0, to = "2 MPa", num = 21 }\n'
    assert facts_of(text)["uplift / weight"] == "0 to 14.6"


# warnings --------------------------------------------------------------------------------------------------------------------


def test_nothing_to_warn_of():
    assert warnings_of(QUIET) == []


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
    (warning,) = warnings_of(QUIET.replace("wall_elements = 8", "wall_elements = 1"))
    bound = 1 + 2.675 + 1.5 * 0.7 * 0.25**2  # elements of 0.125 m along a wall of 0.5 m
    assert warning.startswith(f"the walls may be {bound:.1f} times too stiff in bending")


def test_the_coarsest_wall_of_a_sweep_counts():
    text = QUIET.replace("wall_elements = 8\n", "") + "[sweep]\nwall_elements = [8, 1]\n"
    assert [warning.split(" too stiff")[0] for warning in warnings_of(text)] == ["the walls may be 3.7 times"]


def test_a_bound_under_one_and_a_half_is_not():
    text = QUIET.replace("wall_elements = 8", "wall_elements = 3")
    assert bending_bound(study_of(text).cases[0]) == pytest.approx(1.363, abs=1e-3)
    assert warnings_of(text) == []


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


def test_high_elements_in_soft_ground_are_warned_of():
    """25 Hz is what a record of 10 ms carries well; a sixth of the wave in 50 m/s is then 0.33 m, the elements are 1 m high."""
    soft = '[[layer]]\nbottom = "4 m"\nnu = 0.25\nVs = "50 m/s"\ndensity = "2 t/m**3"\nfriction = 0.3\n'
    hard = '[[layer]]\nbottom = "14 m"\nnu = 0.25\nVs = "800 m/s"\ndensity = "2 t/m**3"\nfriction = 0.3\n'
    model = build_model(study_of(QUIET + soft + hard).cases[0])
    mesh = model.system.mesh
    high = np.ptp(mesh.nodes[mesh.triangles[mesh.material == 0]][:, :, 1], axis=1).max()
    found = [w for w in warnings_of(QUIET + soft + hard) if "shear waves" in w]
    assert found == [f"layer 1 has elements {high:.3g} m high: it carries shear waves up to {50 / 6 / high:.3g} Hz well"]
    assert not [w for w in warnings_of(QUIET + soft.replace('"50 m/s"', '"400 m/s"') + hard) if "shear waves" in w]
