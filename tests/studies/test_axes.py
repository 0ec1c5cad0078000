"""Sweeping: every field that holds one value can be an axis, and the dataset says what was swept."""

import math

import numpy as np
import pytest
import xarray as xr

from engine import Spec
from studies import run_study, write_dataset
from studies.axes import OF_THE_RESULTS, TAKEN
from studies.fields import catalogue, resolve
from studies.schema import COORDINATES, SCHEMA

from .conftest import COARSE, study_of

BRIEF = COARSE + '[time]\ndt = "10 ms"\nduration = "0.2 s"\n[output]\nevery = 1\n'


# every field -----------------------------------------------------------------------------------------------------------------

LAYERS = "".join(
    f'[[layer]]\nbottom = "{bottom} m"\nnu = 0.25\nfriction = 0.3\n{stiffness}\n{weight}\n'
    for bottom, stiffness, weight in (
        (4, 'E = "1 GPa"', 'density = "2 t/m**3"'),
        (9, 'G = "1 GPa"', 'unit_weight = "20 kN/m**3"'),
        (14, 'Vs = "500 m/s"', 'density = "2 t/m**3"'),
    )
)
BASE = COARSE + LAYERS + '[time]\ndt = "10 ms"\nduration = "0.2 s"\nnewmark_beta = 0.3\n'
LAYER_OF = {"G": 2, "unit_weight": 2, "Vs": 3}

WITHOUT_DEFAULT = {
    "motion.vertical_peak": 1.0,
    "motion.reference_depth": 10.0,
    "damping.reference_width": 25.0,
    "damping.reference_depth": 12.0,
    "joint.thickness_ratio": 0.1,
}

NOT_SWEPT = ("motion.record_dt", "output.sections")
"""A record has one time step (test_plan), and all cases of a dataset the same sections (malformed)."""

ALL_VALUES = {"mesh.order": (1, 2)}
"""Of fields that have no more."""


def value_in(spec, name):
    """The value of the field of a dotted name."""
    part = spec
    for key in name.split("."):
        part = part[int(key) - 1] if key.isdigit() else getattr(part, key)
    return part


def swept(name):
    """A field with the number of a layer, and two values of it in SI."""
    name = name.replace(".N.", f".{LAYER_OF.get(name.rpartition('.')[2], 1)}.")
    if name in ALL_VALUES:
        return name, ALL_VALUES[name]
    given = value_in(study_of(BASE).cases[0], name)
    value = WITHOUT_DEFAULT.get(name, given)
    if isinstance(value, int):
        return name, (value, value + 2)
    return name, (value, 1.1 * value or 0.1)


def written(values, unit):
    return "[" + ", ".join(f'"{value!r} {unit}"' if unit else repr(value) for value in values) + "]"


NUMERIC = [field for field in catalogue() if field.single and field.numeric and field.name not in NOT_SWEPT]


@pytest.mark.parametrize("field", NUMERIC, ids=lambda field: field.name)
def test_every_number_can_be_swept_by_its_dotted_name(field):
    """The cases differ in it alone, as the axis says."""
    name, values = swept(field.name)
    study = study_of(BASE + f"[sweep]\n{name} = {written(values, field.unit)}\n")
    (axis,) = study.axes
    assert (axis.name, axis.unit, axis.meaning) == (name.replace(".", "_"), field.unit, field.meaning)
    assert axis.values == pytest.approx(values, rel=1e-14)  # a number written and read, times one
    assert [value_in(case, name) for case in study.cases] == list(axis.values)
    table = name.split(".")[0]
    first, second = (case.model_dump(exclude={table}) for case in study.cases)
    assert first == second
    assert getattr(study.cases[0], table) != getattr(study.cases[1], table)


@pytest.mark.parametrize("field", [f for f in NUMERIC if f.path[0] != "layer"], ids=lambda field: field.name)
def test_every_number_can_be_swept_by_a_range(field):
    """Linear and logarithmic, with whole numbers where the field asks for them."""
    name, (low, high) = swept(field.name)
    ends = [f'"{value!r} {field.unit}"' if field.unit else repr(value) for value in (low, high)]
    whole = isinstance(low, int)
    for spacing in ("linear", *(["log"] if low > 0 and not whole else [])):
        sweep = f'[sweep]\n{name} = {{ from = {ends[0]}, to = {ends[1]}, num = 2, spacing = "{spacing}" }}\n'
        found = [value_in(case, name) for case in study_of(BASE + sweep).cases]
        assert found == pytest.approx([low, high], rel=1e-12)  # powers in floating point
        assert all(isinstance(value, int) is whole for value in found)


@pytest.mark.parametrize("name", OF_THE_RESULTS)
def test_what_decides_the_results_is_a_field_that_each_study_sets(name):
    assert name in NOT_SWEPT
    assert {field.name for field in catalogue()} > set(OF_THE_RESULTS)
    for sections in (3, 9):
        (case,) = study_of(BASE + f"[output]\nsections = {sections}\n").cases
        assert value_in(case, name) == sections


def test_no_axis_has_the_name_of_a_variable():
    """Short names and names with underscores alike; the dataset would lose what the axis is called."""
    taken = set(SCHEMA) | set(COORDINATES) | {dim for variable in SCHEMA.values() for dim in variable.dims}
    taken |= {
        "mesh",
        "mesh_layer",
        "mesh_face_nodes",
        "mesh_node_x",
        "mesh_node_y",
        "joint_nodes",
        "face",
        "corner",
        "joint_corner",
    }
    keys = {key for f in catalogue() if f.single for key in (f.label, f.name.replace(".", "_")) if resolve(key)}
    assert keys & taken == set(TAKEN)
    for key in TAKEN:
        (axis,) = study_of(BASE + f'[sweep]\n{key} = ["2 Hz", "3 Hz"]\n').axes
        assert axis.name not in taken


# some of them, run -----------------------------------------------------------------------------------------------------------

RICKER = BRIEF.replace('"ridgecrest-2019-clc-360.AT2"', '"ricker"') + '[ricker]\narrival = "0.1 s"\n'
SYNTHETIC = BRIEF.replace('"ridgecrest-2019-clc-360.AT2"', '"synthetic"') + '[synthetic]\nrise = "0.1 s"\n'

SWEEPS = {
    "mesh_largest_height": (BRIEF, 'mesh.largest_height = ["3 m", "2 m"]'),
    "roof_elements": (BRIEF, "roof_elements = [4, 6]"),
    "wall_elements": (BRIEF, "wall_elements = [2, 1]"),
    "mesh_order": (BRIEF, "mesh.order = [1, 2]"),
    "corner_levels": (BRIEF, "corner_levels = [1, 0]"),
    "wall": (BRIEF, 'wall = ["0.5 m", "0.8 m"]'),
    "dt": (BRIEF, 'dt = ["5 ms", "10 ms"]'),
    "duration": (BRIEF, 'duration = ["0.1 s", "0.2 s"]'),
    "every": (BRIEF, "every = [1, 2, 4]"),
    "thickness": (BRIEF, 'thickness = ["5 cm", "2 cm"]'),
    "box_width": (BRIEF, 'box.width = ["5 m", "6 m"]'),
    "layer_3_E": (BRIEF, 'layer.3.E = { from = "10 GPa", to = "20 GPa", num = 2 }'),
    "layer_3_bottom": (BRIEF, 'layer_3_bottom = ["8 m", "9 m"]'),
    "sides": (BRIEF, 'sides = ["tied", "roller", "fixed"]'),
    "record": (BRIEF, 'record = ["none", "ricker", "ridgecrest-2019-clc-090.AT2"]\nricker.arrival = ["0.1 s"]'),
    "self_weight": (BRIEF, "self_weight = [true, false]"),
    "synthetic_seed": (SYNTHETIC, "synthetic.seed = [7, 8]"),
    "ricker_frequency": (RICKER, 'frequency = ["5 Hz", "10 Hz"]'),
    "mass": (BRIEF, 'mass = ["lumped", "consistent"]'),
}


def alone(case: Spec, motions):
    """A study of one case."""
    study = study_of("")
    return type(study)("alone", "alone", "", (), (case,), motions)


@pytest.fixture(scope="module", params=SWEEPS)
def run(request, tmp_path_factory):
    """A study of one swept field: its axis, study, dataset, and the dataset as read from its file."""
    base, sweep = SWEEPS[request.param]
    study = study_of(base + f"[sweep]\n{sweep}\n")
    ds = run_study(study, workers=1)
    path = tmp_path_factory.mktemp("swept") / "x.nc"
    write_dataset(ds, path)
    return study.axes[0], study, ds.squeeze(), xr.load_dataset(path, engine="netcdf4").squeeze()


def test_the_axis_is_a_coordinate_with_unit_and_meaning(run, request):
    axis, _, ds, reopened = run
    for each in (ds, reopened):
        assert each["status"].dims == (axis.name,)
        assert tuple(each[axis.name].values.tolist()) == axis.values
        assert each[axis.name].attrs == {"units": axis.unit or "1", "long_name": axis.meaning}
        assert (each["status"] == 0).all()
        for name in ("displacement", "peak_racking", "max_slip", "frequency", "energy_error"):
            assert each[name].dims == (axis.name, *SCHEMA[name].dims)


def test_the_file_holds_the_dataset(run):
    _, _, ds, reopened = run
    xr.testing.assert_equal(ds, reopened)
    assert set(ds.variables) == set(reopened.variables)
    for name in ds.variables:
        assert ds[name].attrs.keys() == reopened[name].attrs.keys()


def test_histories_share_the_coarsest_step_and_the_longest_time(run):
    _, study, ds, _ = run
    step = max(case.time.dt * case.output.every for case in study.cases)
    longest = max(case.time.duration for case in study.cases)
    np.testing.assert_allclose(ds["time"], np.arange(round(longest / step) + 1) * step, rtol=1e-14)


def test_every_case_is_that_of_a_study_of_its_own(run):
    """Its own joints and nodes, then padding; its own steps where the grid holds them, nothing after its end."""
    axis, study, ds, _ = run
    for i, case in enumerate(study.cases):
        one, own = ds.isel({axis.name: i}), run_study(alone(case, study.motions), workers=1)
        for name, variable in SCHEMA.items():
            if name in ("reason", "solved_as"):  # words; the number of the case in its study
                continue
            mine, theirs = one[name].values.astype(float), own[name].values.astype(float)
            if "time" in variable.dims:
                at = [k for k, t in enumerate(own["time"].values) if np.isclose(t, ds["time"].values, rtol=1e-12, atol=0).any()]
                assert len(at) == sum(ds["time"].values <= case.time.duration * (1 + 1e-12))
                theirs, mine, late = theirs[at], mine[: len(at)], mine[len(at) :]
                assert (np.isnan(late) | (late == -1)).all()
            kept = tuple(slice(n) for n in theirs.shape)
            scale = np.abs(theirs[np.isfinite(theirs)]).max(initial=0.0)
            # a batch of lanes and a lane alone: the same operations, summed in another order at most
            np.testing.assert_allclose(mine[kept], theirs, rtol=1e-7, atol=1e-9 * scale, err_msg=name)
            outside = np.ones(mine.shape, dtype=bool)
            outside[kept] = False
            assert (np.isnan(mine[outside]) | (mine[outside] == -1)).all(), name


def test_what_a_sweep_changes_of_the_mesh_carries_its_axis():
    """The width of the box moves points, joints and nodes; a record moves none."""
    wide = run_study(study_of(BRIEF + '[sweep]\nbox.width = ["5 m", "6 m"]\n'), workers=1)
    assert wide["point_x"].dims == ("box_width", "point")
    assert wide["point_x"].sel(point="B").values.tolist() == [2.5, 3.0]
    assert wide["point_y"].dims == ("point",)
    shaken = run_study(study_of(BRIEF + '[sweep]\nrecord = ["none", "ridgecrest-2019-clc-090.AT2"]\n'), workers=1)
    assert shaken["point_x"].dims == ("point",)
    assert shaken["base_acceleration"].dims == ("record", "time", "component")
    assert not math.isnan(float(shaken["displacement"].max()))
