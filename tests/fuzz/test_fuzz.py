"""Two hundred random models, the ends of what floats hold, and poison in the midst: never a quiet wrong number."""

import re
import tomllib
from collections import Counter

import numpy as np
import pytest

from engine import Status, build_model, simulate_cases
from engine.kernels import loop
from studies import StudyError, make_study, run_study
from studies.schema import SCHEMA
from tests.fuzz.__main__ import depth_of
from tests.fuzz.checks import bounds, emptiness, held, imbalances, statuses
from tests.fuzz.examine import LOST, REFUSED, examine, summed
from tests.fuzz.extremes import SMALL, extreme_tables, with_field
from tests.fuzz.models import as_toml, draw
from tests.fuzz.read_anew import misread

SEED, MODELS = 1, 200


@pytest.fixture(scope="module")
def examined():
    """Small models, asked as `make fuzz` asks."""
    return [examine(draw(SEED, number, small=True), depth_of(number)) for number in range(MODELS)]


def test_random_models_hold(examined):
    """No crash, nothing that is not finite in a case that is done, no imbalance that rounding does not explain."""
    assert [(each.drawn.number, each.findings) for each in examined if each.findings] == []


def test_all_random_models_converge(examined):
    """Less than a thousandth of the cases may fail to: of these, none."""
    ended = summed(examined)["all"]
    assert ended["not_converged"] + ended["non_finite"] + ended[LOST] == 0
    assert ended["done"] > 0.9 * ended.total()


def test_the_generator_is_rarely_refused(examined):
    assert summed(examined)["all"][REFUSED] <= 0.02 * MODELS


def test_random_models_are_as_varied_as_they_say(examined):
    """Both orders, all sides, six decades of joints, three of steps, four of contrast, and every edge."""
    features = Counter(feature for each in examined for feature in each.drawn.features)
    wanted = ["T3", "T6", "one-point", "self-weight", "no self-weight", "motion of 1e-12 g", "motion along both", "one step"]
    wanted += [f"sides {sides}" for sides in ("tied", "shear", "roller", "fixed")]
    wanted += [f"joint thickness 1e{k} m" for k in range(-5, 2)] + [f"dt 1e{k} s" for k in (-4, -3, -2)]
    wanted += ["contrast 1e0 to 1e1", "contrast 1e3 to 1e4", "friction up to 0", "friction up to 2", "boundary at a corner"]
    wanted += ["roof at the surface", "floor near the base", "wall near the side", "damped joints", "dissipative scheme"]
    assert [feature for feature in wanted if features[feature] < 2] == []


def test_reference_and_relations_have_their_say(examined):
    """Single steps agree with the reference's, and the model told in other ways answers the same."""
    told = sum((each.told for each in examined), Counter())
    assert told["step agrees to 1e-10"] > 50
    for relation in ("N and cm", "mirror", "translation", "twice as thick", "layer in two", "times 3", "superposition"):
        assert told[f"{relation} holds"] >= 2
    assert told["lanes in another order, record at its own rate"] >= 4
    assert told["case read anew"] > 10


def test_a_model_is_its_study_file():
    for number in range(20):
        table = draw(7, number).table
        assert tomllib.loads(as_toml(table)) == table


# ---- the checks can fail ----


@pytest.fixture(scope="module")
def small():
    study = make_study(SMALL)
    return study, run_study(study, workers=1)


def test_a_value_that_is_not_finite_is_found(small):
    _, ds = small
    assert emptiness(ds) == []
    for name, poison in (("stress", np.nan), ("frequency", np.inf), ("joint_state", -1)):
        spoilt = ds.copy(deep=True)
        spoilt[name].values.flat[0] = poison
        assert [line for line in emptiness(spoilt) if name in line], name


def test_a_value_of_a_failed_case_and_a_failure_without_reason_are_found(small):
    _, ds = small
    spoilt = ds.copy(deep=True)
    spoilt["status"].values[...] = Status.NOT_CONVERGED
    lines = emptiness(spoilt)
    assert any("NOT_CONVERGED with the reason ''" in line for line in lines)
    assert any("displacement holds a value" in line for line in lines)


def test_an_imbalance_that_rounding_does_not_explain_is_found(small):
    study, ds = small
    model = build_model(study.cases[0])
    limit = bounds(model, list(study.cases), [study.ground(0)])
    assert imbalances(study, ds, lambda: model) == []
    assert ds.residual.values <= limit.residual[0] < 1e-12
    spoilt = ds.assign(energy_error=ds.energy_error + 1e-3, residual=ds.residual + 1e-6)
    assert len(imbalances(study, spoilt, lambda: model)) == 2


NOT_READ_ANEW = {
    "reference_displacement",
    "flexibility_ratio",
    "response_spectrum",
    "iterations",
    "residual",
    "source_test",
    "energy_error",
    "contact_drift",
    "status",
    "reason",
    "solved_as",
    "scaled_by",
}
"""Variables of the box or the motion by itself, of the solver, and what is zero here: other tests are for them."""


@pytest.fixture(scope="module")
def shaken():
    """A box that slides and opens, with a case that follows from it, and what reads them anew."""
    motion = {**SMALL["motion"], "peak": "6 m/s**2"}
    loads = {"motion": motion, "gravity": {"self_weight": False}, "sweep": {"p0": ["20 kPa", "10 kPa"], "scale": [1.0, 0.5]}}
    study = make_study({**SMALL, **loads, "joint": {"thickness": "1 m"}})
    ds = run_study(study, workers=1)
    assert study.scaling.followers == {0: [3]}
    assert float(ds.slip_work.max()) > 0
    assert float(ds.max_opening.max()) > 0
    assert np.isfinite(ds.first_slip).any()
    model = build_model(study.cases[0])
    return ds, lambda spoilt: misread(study, spoilt, model, [0])


def test_what_a_march_gives_is_read_anew_as_the_dataset_says_it(shaken):
    ds, read = shaken
    assert read(ds) == []


@pytest.mark.parametrize("case", [0, -1], ids=["solved", "follows"])
def test_variables_that_differ_from_the_march_in_the_sixth_digit_are_found(case, shaken):
    """In one place each, the largest value of the case."""
    ds, read = shaken
    spoilt, names = ds.copy(deep=True), SCHEMA.keys() - NOT_READ_ANEW
    for name in names:
        values, of_case = spoilt[name].values, np.zeros(spoilt[name].shape, dtype=bool)
        of_case[tuple(case if axis in ("p0", "scale") else slice(None) for axis in spoilt[name].dims)] = True
        at = np.nanargmax(np.where(of_case, abs(values), -1))
        assert values.flat[at] != 0, name
        values.flat[at] = (values.flat[at] + 1) % 4 if SCHEMA[name].flags else values.flat[at] * (1 + 1e-5)
    lines = read(spoilt)
    assert [name for name in names if not any(re.match(rf"case {case % 4}: {name}\b", line) for line in lines)] == []


def test_what_nothing_holds_is_told_from_what_friction_holds():
    """A box at the surface lifted by more than it weighs; walls hold it by friction, for which they must be pressed."""
    table = with_field(("box", "depth"), 0.0) | {"pressure": {"p0": "4 MPa"}}
    spec = make_study(table).cases[0]
    model = build_model(spec)
    smooth = spec.model_copy(update={"layer": tuple(layer.model_copy(update={"friction": 0.0}) for layer in spec.layer)})
    assert not held(model, smooth, friction=True)
    assert not held(model, spec, friction=False)
    assert held(model, spec, friction=True)
    light = spec.model_copy(update={"pressure": spec.pressure.model_copy(update={"p0": 1e4})})
    assert held(model, light, friction=False)


# ---- the ends of what floats hold ----

CHOSEN = (
    "time.",
    "pressure.",
    "motion.",
    "damping.",
    "box.depth",
    "box.E",
    "joint.",
    "layer.N.E",
    "layer.N.friction",
    "gravity.",
)


@pytest.mark.filterwarnings("ignore:.*singular:RuntimeWarning")
def test_every_number_at_its_ends_is_refused_or_solved_or_fails_with_a_reason():
    """Zero, denormal, tiny, huge, near overflow: a message or a status, and never a value that is not finite."""
    ended = Counter()
    for name, table in extreme_tables():
        if not name.startswith(CHOSEN):
            continue
        try:
            study = make_study(table)
            ds = run_study(study, workers=1)
        except StudyError:
            ended["refused"] += 1
            continue
        assert emptiness(ds) == [], name
        ended.update(status.name for status in statuses(ds))
    assert ended["refused"] > 50
    assert ended["DONE"] > 20
    assert ended["NOT_CONVERGED"] == 0


# ---- poison ----


@pytest.mark.parametrize("poison", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("where", ["u", "v", "a"])
def test_poison_in_a_lane_s_motion_is_a_status_and_stays_in_its_lane(monkeypatch, poison, where):
    """A value that a kernel would return as NaN or infinite, in the second of three lanes, after the fourth step."""
    study = make_study({**SMALL, "sweep": {"p0": ["0.1 MPa", "0.2 MPa", "0.3 MPa"]}})
    model, specs, motions = build_model(study.cases[0]), list(study.cases), [study.ground(i) for i in range(3)]
    clean = simulate_cases(model, specs, motions)

    def poisoned(first, stage, end, of, drive, pots, watches, motion, contact, account):
        if drive.n_lane != 3 or stage != loop.TO_SOLVE or not first <= 5 < end or watches.every > 1000:
            return loop.march(first, stage, end, of, drive, pots, watches, motion, contact, account)
        reached = loop.march(first, stage, 5, of, drive, pots, watches, motion, contact, account)
        if reached != (5, loop.TO_SOLVE):
            return reached
        getattr(motion, where)[3, 1] = poison
        return loop.march(5, stage, end, of, drive, pots, watches, motion, contact, account)

    monkeypatch.setattr("engine.newmark.march", poisoned)
    found = simulate_cases(model, specs, motions)
    assert found.status.tolist() == [Status.DONE, Status.NON_FINITE, Status.DONE]
    assert "finite" in found.reason[1]
    assert np.isnan(found.values[1]).all()
    for lane in (0, 2):
        np.testing.assert_array_equal(found.values[lane], clean.values[lane])
