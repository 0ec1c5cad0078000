"""The dataset: what the schema promises is there, describes itself, survives netCDF, and says nothing that was not computed."""

import re

import numpy as np
import pytest
import xarray as xr
from netCDF4 import Dataset
from pint import UnitRegistry

from engine import PERIODS, Status, build_model, response_spectrum, simulate_cases
from engine.flexibility import flexibility_ratio
from engine.kernels.joint import OPEN, SLIP_BACKWARD, SLIP_FORWARD, STICK
from studies import run_study, write_dataset
from studies.schema import COORDINATES, EXTREMES, JOINT_STATES, SCHEMA, described

from .conftest import LOOSE, SHORT, study_of

PROMISED = {
    "displacement": ("time", "point", "component"),
    "stress": ("time", "point", "stress_component"),
    "racking": ("time",),
    "racking_shear": ("time",),
    "open_fraction": ("time",),
    "slip_fraction": ("time",),
    "joint_state": ("time", "joint"),
    "max_opening": ("joint",),
    "max_slip": ("joint",),
    "max_pressure": ("joint",),
    "peak_displacement": ("point", "component"),
    "peak_displacement_dynamic": ("point", "component"),
    "peak_stress": ("point", "stress_component"),
    "peak_stress_dynamic": ("point", "stress_component"),
    "peak_racking": (),
    "peak_racking_dynamic": (),
    "status": (),
    "reason": (),
    "iterations": (),
    "residual": (),
    "energy_error": (),
    "contact_drift": (),
    "penetration": (),
    "frequency": ("mode",),
    "closed_before_shaking": (),
    "uplift_over_weight": (),
    "principal_stress": ("time", "point", "principal"),
    "max_principal_stress": ("point",),
    "min_principal_stress": ("point",),
    "axial_force": ("time", "section"),
    "shear_force": ("time", "section"),
    "bending_moment": ("time", "section"),
    "extreme_axial_force": ("section", "extreme"),
    "extreme_shear_force": ("section", "extreme"),
    "extreme_bending_moment": ("section", "extreme"),
    "extreme_time": ("section", "extreme"),
    "opened_length": ("time",),
    "slip_work": ("time",),
    "joint_pressure": ("time", "joint"),
    "joint_slip": ("time", "joint"),
    "joint_slip_work": ("joint",),
    "racking_ratio": (),
    "flexibility_ratio": (),
}
"""The table of DESIGN section 5."""

UNITS = {
    "displacement": "m",
    "stress": "Pa",
    "racking": "m",
    "open_fraction": "1",
    "max_opening": "m",
    "max_pressure": "Pa",
    "peak_stress": "Pa",
    "energy_error": "1",
    "penetration": "m",
    "frequency": "Hz",
    "base_acceleration": "m/s2",
    "response_spectrum": "m/s2",
    "closed_before_shaking": "1",
    "principal_stress": "Pa",
    "axial_force": "N m-1",
    "shear_force": "N m-1",
    "bending_moment": "N m m-1",
    "extreme_bending_moment": "N m m-1",
    "extreme_time": "s",
    "opened_length": "m",
    "slip_work": "J m-1",
    "joint_slip_work": "J m-2",
    "joint_pressure": "Pa",
    "joint_slip": "m",
    "racking_ratio": "1",
    "flexibility_ratio": "1",
    "section_position": "m",
}
MESH = {"mesh", "mesh_face_nodes", "mesh_layer", "joint_nodes"}
NOT_OF_THE_RESPONSE = {
    "status",
    "reason",
    "racking_free_field",
    "peak_racking_free_field",
    "reference_displacement",
    "frequency",
    "base_acceleration",
    "peak_base_acceleration",
    "response_spectrum",
    "uplift_over_weight",
    "flexibility_ratio",
    "solved_as",
    "scaled_by",
}
"""Known of a case before it is marched: kept where it fails."""

OF_MOTION = ("base_acceleration", "peak_base_acceleration", "response_spectrum")

FLAGS = ("joint_state", "shape_state", "status")

SINGLE = ("axial_force", "shear_force", "bending_moment", "joint_pressure", "joint_slip")
"""Histories in single precision: seven figures are more than a mesh gives."""


def attributes(ds):
    """Every attribute of the dataset and its variables, with the name of its owner."""
    yield from (("", name, value) for name, value in ds.attrs.items())
    for owner in ds.variables:
        yield from ((owner, name, value) for name, value in ds[owner].attrs.items())


def swept(sweep, extra=""):
    """Dataset of a sweep on the coarse mesh."""
    return run_study(study_of(f"{SHORT}{extra}[sweep]\n{sweep}"), workers=1)


def dtype_of(name):
    """Of a variable of the schema, in memory and in the file."""
    if name in FLAGS:
        return np.int8
    kinds = {"reason": str, "solved_as": np.int32} | dict.fromkeys(SINGLE, np.float32)
    return kinds.get(name, np.float64)


@pytest.mark.parametrize(("name", "dims"), PROMISED.items(), ids=PROMISED)
def test_the_designs_table_is_there(name, dims, quick_ds):
    assert quick_ds[name].dims == ("p0", *dims)


@pytest.mark.parametrize("name", SCHEMA)
def test_every_variable_has_its_dims_and_describes_itself(name, quick_ds):
    """All carry the swept axis but those of the motion, which the pressure does not change."""
    variable = SCHEMA[name]
    assert quick_ds[name].dims == (() if name in OF_MOTION else ("p0",)) + variable.dims
    assert quick_ds[name].attrs.get("units", "") == variable.unit
    assert quick_ds[name].attrs["long_name"] == variable.long_name
    assert len(variable.long_name) > 5


@pytest.mark.parametrize(("name", "unit"), UNITS.items(), ids=UNITS)
def test_units_are_si(name, unit, quick_ds):
    assert quick_ds[name].attrs["units"] == unit


def test_nothing_else_gets_in(quick_ds):
    assert set(quick_ds.data_vars) == set(SCHEMA) | MESH


@pytest.mark.parametrize("name", [name for name in SCHEMA if name != "reason"])
def test_precision_is_the_schemas_in_memory_and_in_the_file(name, quick_ds, reopened):
    assert SCHEMA[name].single == (name in SINGLE)
    assert quick_ds[name].dtype == reopened[name].dtype == dtype_of(name)


def test_a_description_holds_what_is_there():
    assert described("m", "a length") == {"units": "m", "long_name": "a length"}
    assert described("", "a word", "of some meaning") == {"long_name": "a word", "comment": "of some meaning"}


@pytest.mark.parametrize("name", COORDINATES)
def test_coordinates_describe_themselves(name, quick_ds):
    coordinate = COORDINATES[name]
    assert quick_ds.coords[name].dims == coordinate.dims
    assert quick_ds[name].attrs["long_name"] == coordinate.long_name


def test_every_unit_is_one(reopened):
    registry = UnitRegistry()
    units = {value for _, name, value in attributes(reopened) if name == "units"}
    assert {"m", "Pa", "s", "Hz", "m/s2", "1", "N m-1", "N m m-1", "J m-1", "J m-2"} <= units
    for unit in units - {"1"}:
        powers = re.sub(r"(?<=[a-z])(-?\d)", r"**\1", unit)  # as pint writes them
        assert registry.parse_units(powers.replace(" ", "*"))


def test_swept_fields_are_coordinates_with_unit_and_meaning(reopened):
    p0 = reopened["p0"]
    assert p0.values.tolist() == pytest.approx([0.0, 2e4, np.sqrt(2e4 * 4e6), 4e6], rel=1e-14)  # a geometric sequence
    assert p0.attrs["units"] == "Pa"
    assert p0.attrs["long_name"] == "pressure at the reference height"


def test_attributes_are_text_and_numbers_only(quick_ds, reopened):
    """No bool, None or dict: netCDF knows none of them. The only lists are the values of flags."""
    for ds in (quick_ds, reopened):
        for owner, name, value in attributes(ds):
            if name == "flag_values":
                assert value.dtype == np.int8
            else:
                assert isinstance(value, (str, np.integer, np.floating)), f"{owner}.{name} = {value!r}"


@pytest.mark.parametrize("name", FLAGS)
def test_flags_are_as_the_conventions_want_them(name, reopened):
    """CF-1.11 section 3.5: flag_values of the variable's own type, a word for each of them, blanks between words alone."""
    attrs = reopened[name].attrs
    words = attrs["flag_meanings"].split(" ")
    assert reopened[name].dtype == attrs["flag_values"].dtype == np.int8
    assert attrs["flag_values"].tolist() == list(range(len(words)))
    assert all(re.fullmatch(r"[A-Za-z0-9_\-.+@]+", word) for word in words)
    assert set(np.unique(reopened[name])) <= {-1, *attrs["flag_values"].tolist()}
    assert "units" not in attrs


def test_flags_are_those_of_the_engine(reopened):
    assert reopened["status"].attrs["flag_meanings"] == " ".join(status.name.lower() for status in Status)
    assert [int(status) for status in Status] == list(range(len(Status)))
    for name in ("joint_state", "shape_state"):
        assert reopened[name].attrs["flag_meanings"].split() == list(JOINT_STATES)
    assert (OPEN, STICK, SLIP_FORWARD, SLIP_BACKWARD) == (0, 1, 2, 3)


def test_round_trip_through_netcdf(quick_ds, reopened):
    xr.testing.assert_equal(quick_ds, reopened)
    assert dict(quick_ds.sizes) == dict(reopened.sizes)
    for name in quick_ds.variables:
        before, after = quick_ds[name].attrs, reopened[name].attrs
        assert before.keys() == after.keys()
        for key in before:
            np.testing.assert_array_equal(before[key], after[key], err_msg=f"{name}.{key}")


def test_the_file_says_the_same_without_xarray(quick_file, quick_ds):
    """What a reader of another language finds: every variable with its text, flags in bytes, no number that stands for NaN."""
    with Dataset(quick_file) as file:
        assert file.Conventions == "CF-1.11 UGRID-1.0"
        for name, variable in SCHEMA.items():
            found = file[name]
            assert found.long_name == variable.long_name
            assert getattr(found, "units", "") == variable.unit
            assert found.dtype == dtype_of(name)
            if name in FLAGS:
                assert "_FillValue" not in found.ncattrs()  # -1 stays a whole number
                np.testing.assert_array_equal(found[:], quick_ds[name].values)
            for dim in found.dimensions:
                assert dim in file.dimensions
        for name in ("time", "period", "p0"):
            assert file[name].dimensions == (name,)
            assert {"units", "long_name"} <= set(file[name].ncattrs())


def test_a_case_is_chosen_as_the_readme_says(quick_file):
    with xr.open_dataset(quick_file) as ds:
        chosen = ds.sel(p0=2e6, method="nearest").sel(point="A").displacement
        assert chosen.dims == ("time", "component")
        assert float(chosen["p0"]) == pytest.approx(np.sqrt(2e4 * 4e6), rel=1e-14)
        assert np.isfinite(chosen.values).all()
        assert (float(chosen["point_x"]), float(chosen["point_y"])) == (0.0, -4.0)


# one case against itself -----------------------------------------------------------------------------------------------


def test_named_points_lie_where_the_design_says(reopened):
    places = {
        name: (float(x), float(y))
        for name, x, y in zip(reopened["point"].values, reopened["point_x"], reopened["point_y"], strict=True)
    }
    expected = {"A": (0, -4), "B": (2.5, -6), "C": (-2.5, -6), "D": (0, -8), "S": (0, 0), "F": (10, 0)}
    assert places == {name: pytest.approx(place, abs=1e-12) for name, place in expected.items()}


def test_further_points_are_recorded():
    ds = swept("p0 = [0]", '[output.points]\ndeep = ["5 m", "-12 m"]\n')
    assert (float(ds.sel(point="deep").point_x), float(ds.sel(point="deep").point_y)) == (5.0, -12.0)
    assert np.isfinite(ds["displacement"].sel(point="deep")).all()


def test_time_starts_at_zero_and_keeps_every_second_step(quick_ds):
    np.testing.assert_allclose(quick_ds["time"], np.arange(21) * 0.02, rtol=0, atol=1e-15)


def test_base_acceleration_is_that_of_the_study(quick_ds, quick):
    for case in range(4):
        np.testing.assert_array_equal(quick_ds["base_acceleration"], quick.ground(case)[::2])
    assert float(quick_ds["peak_base_acceleration"].sel(component="x")) == pytest.approx(1.7085, rel=1e-14)
    assert float(quick_ds["peak_base_acceleration"].sel(component="y")) == 0


def test_response_spectrum_is_that_of_the_whole_motion(quick_ds, quick):
    """Of every step, not only of those that are kept; bit by bit, for it is the same computation."""
    np.testing.assert_array_equal(quick_ds["response_spectrum"], response_spectrum(quick.ground(0), 0.01))
    np.testing.assert_array_equal(quick_ds["period"], PERIODS)
    assert quick_ds["response_spectrum"].dims == ("period", "component")
    assert quick_ds["period"].attrs["units"] == "s"
    kept = response_spectrum(quick.ground(0)[::2], 0.02)
    assert not np.allclose(kept[:, 0], quick_ds["response_spectrum"].sel(component="x"), rtol=0.01)


RECORDS = 'record = ["ridgecrest-2019-clc-360.AT2", "ridgecrest-2019-clc-090.AT2"]'


@pytest.mark.parametrize(
    ("sweep", "axes"),
    [
        ('p0 = [0, "4 MPa"]', ()),
        ('p0 = [0, "4 MPa"]\nscale = [0.5, 1, 2]', ("scale",)),
        (f'scale = [0.5, 2]\np0 = [0, "4 MPa"]\n{RECORDS}', ("scale", "record")),
        ('duration = ["0.2 s", "0.4 s"]\nself_weight = [true, false]', ("duration",)),
        ('scale = [1, 1.0000000001]\np0 = ["4 MPa"]', ("scale",)),
        ('scale = [2]\np0 = [0, "4 MPa"]', ()),
    ],
    ids=["pressure", "pressure and scale", "scale, pressure and record", "duration", "hardly", "one value"],
)
def test_the_motion_carries_the_axes_along_which_it_changes(sweep, axes):
    study = study_of(f"{SHORT}[sweep]\n{sweep}")
    ds = run_study(study, workers=1)
    assert ds["base_acceleration"].dims == (*axes, "time", "component")
    for case in range(len(study.cases)):
        place = dict(zip((axis.name for axis in study.axes), np.unravel_index(case, study.shape), strict=True))
        here = ds.isel(place)
        motion = study.ground(case)
        kept = motion[::2]
        np.testing.assert_array_equal(here["base_acceleration"][: len(kept)], kept)
        assert np.isnan(here["base_acceleration"][len(kept) :]).all()
        np.testing.assert_array_equal(here["peak_base_acceleration"], abs(motion).max(axis=0))
        np.testing.assert_array_equal(here["response_spectrum"], response_spectrum(motion, 0.01))


def test_a_deeper_base_has_a_motion_of_its_own():
    """Where the record stays at its depth; where it moves down with the base, it is one motion for all."""
    sweep = '[sweep]\ndomain_depth = ["14 m", "20 m"]\n'
    beside = run_study(study_of(SHORT.replace("[mesh]", 'reference_depth = "14 m"\n[mesh]') + sweep), workers=1)
    assert beside["base_acceleration"].dims == ("domain_depth", "time", "component")
    assert beside["response_spectrum"].dims == ("domain_depth", "period", "component")
    assert not beside["reference_displacement"].sel(domain_depth=14).any()
    assert beside["reference_displacement"].sel(domain_depth=20, component="x").any()
    below = run_study(study_of(SHORT + sweep), workers=1)
    assert below["base_acceleration"].dims == ("time", "component")
    assert not below["reference_displacement"].any()


@pytest.mark.parametrize("depth", ["", 'reference_depth = "14 m"\n'], ids=["at the base", "said to be at the base"])
def test_reference_displacement_is_zero_where_the_record_is_the_base_motion(depth):
    ds = run_study(study_of(SHORT.replace("[mesh]", f"{depth}[mesh]")), workers=1)
    assert ds["reference_displacement"].dims == ("time", "component")
    assert not ds["reference_displacement"].any()


def test_base_and_reference_displacement_give_the_record_back():
    """Base acceleration plus second difference of the reference displacement, as the trapezoidal rule averages (test_carry)."""
    text = SHORT.replace("ridgecrest-2019-clc-360.AT2", "ricker").replace("[mesh]", 'reference_depth = "8 m"\n[mesh]')
    text = text.replace('"0.4 s"', '"1 s"') + '[ricker]\nfrequency = "4 Hz"\narrival = "0.5 s"\n[output]\nevery = 1\n'
    study = study_of(text)
    ds = run_study(study, workers=1).sel(component="x")
    base, u, record = ds["base_acceleration"].values, ds["reference_displacement"].values, study.ground(0)[:, 0]

    def averaged(a):
        return (a[2:] + 2 * a[1:-1] + a[:-2]) / 4

    back = averaged(base) + (u[2:] - 2 * u[1:-1] + u[:-2]) / 0.01**2
    assert abs(base - record).max() > 0.01 * abs(record).max()  # the base does move otherwise
    # a wavelet at rest at both ends is carried down by the scheme that marches it: second differences of 1e-4 m round at 1e-16
    np.testing.assert_allclose(back, averaged(record), rtol=0, atol=1e-10 * abs(record).max())


def test_peaks_see_every_step(quick_ds):
    for name in ("displacement", "stress", "racking", "racking_shear"):
        history = np.abs(quick_ds[name]).max("time")
        assert (quick_ds[f"peak_{name}"] >= history).all()
    assert (quick_ds["max_opening"] >= quick_ds["gap_before_shaking"]).all()
    assert (quick_ds["max_pressure"] >= 0).all()


def test_peaks_are_those_of_the_history_where_every_step_is_kept():
    ds = swept('p0 = [0, "4 MPa"]', "[output]\nevery = 1\n")
    for name in ("displacement", "stress"):
        history = ds[name]
        np.testing.assert_array_equal(ds[f"peak_{name}"], np.abs(history).max("time"))
        np.testing.assert_array_equal(ds[f"peak_{name}_dynamic"], np.abs(history - history.isel(time=0)).max("time"))
    np.testing.assert_array_equal(ds["peak_racking"], np.abs(ds["racking"]).max("time"))
    np.testing.assert_allclose(ds["peak_racking_free_field"], np.abs(ds["racking_free_field"]).max("time"), rtol=1e-14)
    moment = np.abs(ds["racking"]).argmax("time")
    np.testing.assert_array_equal(ds["shape_time"], ds["time"].values[moment])


def test_fractions_and_static_state_agree(quick_ds):
    at_start = 1 - quick_ds["open_fraction"].isel(time=0)
    # both are sums of the same lengths in another order
    np.testing.assert_allclose(quick_ds["closed_before_shaking"], at_start, rtol=0, atol=1e-14)
    assert (quick_ds["open_fraction"] + quick_ds["slip_fraction"] <= 1 + 1e-14).all()


@pytest.mark.parametrize("quadrature", ["nodal", "one-point"])
def test_joint_states_make_up_the_fractions(quadrature):
    """At every time kept, the states weighted by tributary length are the shares that are open and that slip."""
    ds = swept('p0 = [0, "0.283 MPa"]', f'[joint]\nquadrature = "{quadrature}"\n')
    state, weight = ds["joint_state"], ds["joint_length"] / ds["joint_length"].sum()
    assert set(np.unique(state)) == {0, 1, 2, 3}  # the test tells them apart
    for name, named in (("open_fraction", state == 0), ("slip_fraction", state > 1)):
        share = (named * weight).sum("joint").transpose(*ds[name].dims)
        np.testing.assert_allclose(share, ds[name], rtol=0, atol=1e-14, err_msg=name)  # one sum in another order


def test_joint_states_begin_with_the_state_before_the_shaking(quick_ds):
    start = quick_ds["joint_state"].isel(time=0)
    np.testing.assert_array_equal(start == 0, quick_ds["gap_before_shaking"] >= 0)
    closed = (start > 0) @ quick_ds["joint_length"] / quick_ds["joint_length"].sum()
    np.testing.assert_allclose(closed, quick_ds["closed_before_shaking"], rtol=0, atol=1e-14)  # one sum in another order


def test_joint_states_at_the_largest_racking_are_those_of_that_moment():
    ds = swept('p0 = [0, "0.283 MPa"]', "[output]\nevery = 1\n")
    at = abs(ds["racking"]).argmax("time")
    np.testing.assert_array_equal(ds["joint_state"].isel(time=at), ds["shape_state"])


def test_first_slip_comes_within_the_motion(quick_ds):
    times = quick_ds["first_slip"].values
    known = times[~np.isnan(times)]
    assert known.size
    assert (known > 0).all()
    assert (known <= 0.4).all()


def test_joint_runs_round_the_box(quick_ds):
    ds = quick_ds
    assert float(ds["joint_length"].sum()) == pytest.approx(18.0, rel=1e-14)  # 2 (5 m + 4 m)
    lines = {
        "floor": ("joint_y", -8.0),
        "roof": ("joint_y", -4.0),
        "left wall": ("joint_x", -2.5),
        "right wall": ("joint_x", 2.5),
    }
    assert set(ds["joint_side"].values) == set(lines)
    for side, (coordinate, place) in lines.items():
        on = ds["joint_side"].values == side
        assert ds[coordinate].values[on] == pytest.approx(place, abs=1e-12)
    start = {"floor": 0.0, "right wall": 5.0, "roof": 9.0, "left wall": 14.0}
    for side, begin in start.items():
        arc = ds["joint_arc"].values[ds["joint_side"].values == side]
        assert arc.min() == pytest.approx(begin, abs=1e-12)


def test_uplift_over_weight_is_the_closed_form(quick_ds):
    """p0 (height/H_ref) width over the weight of 8 m² of concrete; 2.857 MN/m at 2 MPa (DESIGN section 1)."""
    expected = quick_ds["p0"] * 4 / 14 * 5 / (8 * 2500 * 9.81)
    np.testing.assert_allclose(quick_ds["uplift_over_weight"], expected, rtol=1e-12, atol=1e-15)  # sums of a few nodes' forces


def test_energy_closes(quick_ds):
    assert (quick_ds["energy_error"] <= 1e-9).all()  # (D11)


def test_a_case_without_motion_has_no_energy_error():
    """At rest there is nothing to divide by: 0/0 counts as met."""
    ds = swept("scale = [0, 1]")
    assert (ds["energy_error"] <= 1e-9).all()  # (D11)


# principal stresses ----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def response(quick):
    """What the engine answers to the only batch of the quick study."""
    return simulate_cases(build_model(quick.cases[0]), quick.cases, [quick.ground(i) for i in range(4)])


OF_THE_RESPONSE = {
    "axial_force": lambda r: r.section_forces[..., 0],
    "shear_force": lambda r: r.section_forces[..., 1],
    "bending_moment": lambda r: r.section_forces[..., 2],
    "extreme_axial_force": lambda r: r.section_extremes[..., 0],
    "extreme_shear_force": lambda r: r.section_extremes[..., 1],
    "extreme_bending_moment": lambda r: r.section_extremes[..., 2],
    "extreme_time": lambda r: r.section_times,
    "stress": lambda r: r.recorder.stress(r.values),
    "max_principal_stress": lambda r: r.principal_extremes[:, 0],
    "min_principal_stress": lambda r: r.principal_extremes[:, 1],
    "joint_pressure": lambda r: r.pressure,
    "joint_slip": lambda r: r.slip,
    "slip_work": lambda r: r.friction_work,
    "joint_state": lambda r: r.states,
}


@pytest.mark.parametrize("name", OF_THE_RESPONSE)
def test_variables_are_those_of_the_response(name, response, quick_ds):
    """Bit by bit: it is the same computation."""
    np.testing.assert_array_equal(quick_ds[name], OF_THE_RESPONSE[name](response))
    assert np.isfinite(quick_ds[name]).all()


def tensors(ds):
    """Stresses as symmetric tensors (…, 3, 3)."""
    xx, yy, xy, zz = (ds["stress"].sel(stress_component=name).values for name in ("xx", "yy", "xy", "zz"))
    nothing = np.zeros_like(xx)
    rows = ((xx, xy, nothing), (xy, yy, nothing), (nothing, nothing, zz))
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def test_principal_stresses_are_the_eigenvalues(quick_ds):
    assert quick_ds["principal"].values.tolist() == [1, 2, 3]
    expected = np.linalg.eigvalsh(tensors(quick_ds))[..., ::-1]
    # a dozen operations on numbers as large as the largest stress
    np.testing.assert_allclose(quick_ds["principal_stress"], expected, rtol=0, atol=1e-14 * np.abs(expected).max())
    assert (np.diff(quick_ds["principal_stress"], axis=-1) <= 0).all()


def test_the_stress_out_of_the_plane_is_that_of_plane_strain(quick_ds):
    """nu (xx + yy), with the box's nu at its four points and the first layer's at the surface."""
    nu = xr.DataArray([0.3] * 4 + [0.22] * 2, dims="point")
    stress = quick_ds["stress"]
    expected = (stress.sel(stress_component="xx") + stress.sel(stress_component="yy")) * nu
    scale = float(np.abs(stress).max())
    # a sum over the nodes of a triangle, taken apart and together
    np.testing.assert_allclose(stress.sel(stress_component="zz"), expected, rtol=1e-12, atol=1e-13 * scale)


@pytest.fixture(scope="module")
def every_step():
    """Two cases that keep every step, with joints that open, stick and slip."""
    return swept('p0 = ["0.283 MPa", "4 MPa"]', "[output]\nevery = 1\n")


def test_extreme_principal_stresses_are_those_of_the_history(every_step):
    history = every_step["principal_stress"]
    atol = 1e-14 * float(np.abs(history).max())  # the same few operations in another order
    np.testing.assert_allclose(every_step["max_principal_stress"], history.max(("time", "principal")), rtol=0, atol=atol)
    np.testing.assert_allclose(every_step["min_principal_stress"], history.min(("time", "principal")), rtol=0, atol=atol)


def test_extreme_principal_stresses_see_every_step(quick_ds):
    atol = 1e-14 * float(np.abs(quick_ds["stress"]).max())
    history = quick_ds["principal_stress"]
    assert (quick_ds["max_principal_stress"] >= history.max(("time", "principal")) - atol).all()
    assert (quick_ds["min_principal_stress"] <= history.min(("time", "principal")) + atol).all()


# sections --------------------------------------------------------------------------------------------------------------------

FORCES = {"N": "axial_force", "Q": "shear_force", "M": "bending_moment"}

NAMES = [
    f"{member} {place}"
    for member, first, last in (
        ("floor", "left", "right"),
        ("right wall", "bottom", "top"),
        ("roof", "left", "right"),
        ("left wall", "bottom", "top"),
    )
    for place in (first, "0.25", "middle", "0.75", last)
]


def test_sections_are_named_after_their_members(reopened):
    assert reopened["section"].values.tolist() == NAMES
    assert reopened["section_member"].values.tolist() == [name.rpartition(" ")[0] for name in NAMES]
    assert reopened["extreme"].values.tolist() == list(EXTREMES) == ["max N", "min N", "max Q", "min Q", "max M", "min M"]


def test_sections_lie_on_the_centre_lines(reopened):
    """Of a box 5 m x 4 m with walls of 0.5 m, its roof at 4 m; positions run from the left or from below."""
    ds = reopened
    lines = {
        "floor": ("section_y", -7.75),
        "roof": ("section_y", -4.25),
        "left wall": ("section_x", -2.25),
        "right wall": ("section_x", 2.25),
    }
    for member, (coordinate, place) in lines.items():
        on = ds.isel(section=np.flatnonzero(ds["section_member"].values == member))
        np.testing.assert_allclose(on[coordinate], place, rtol=0, atol=1e-12)
        from_the_end = on["section_y"] + 7.5 if "wall" in member else on["section_x"] + 2.0
        np.testing.assert_allclose(on["section_position"], from_the_end, rtol=0, atol=1e-12)
        span = 3.0 if "wall" in member else 4.0
        assert on["section_position"].values[[0, 2, 4]] == pytest.approx([0, span / 2, span], abs=1e-12)


@pytest.mark.parametrize(("letter", "name"), FORCES.items())
def test_extremes_are_those_of_the_history_where_every_step_is_kept(letter, name, every_step):
    """Rounding to single precision keeps the order, so that the largest value rounded is the largest of the rounded ones."""
    history, extreme = every_step[name], every_step[f"extreme_{name}"].astype(np.float32)
    np.testing.assert_array_equal(extreme.sel(extreme=f"max {letter}"), history.max("time"))
    np.testing.assert_array_equal(extreme.sel(extreme=f"min {letter}"), history.min("time"))


@pytest.mark.parametrize("name", FORCES.values())
def test_with_every_extreme_come_the_other_forces_of_that_moment(name, every_step):
    moments = every_step["extreme_time"]
    steps = (moments / 0.01).round().astype(int)
    np.testing.assert_allclose(moments, 0.01 * steps, rtol=1e-14, atol=0)
    assert len(np.unique(steps)) > 5  # the test tells moments apart
    concurrent = every_step[name].isel(time=steps).transpose(*moments.dims)
    np.testing.assert_array_equal(every_step[f"extreme_{name}"].astype(np.float32), concurrent)


def test_extremes_see_every_step(quick_ds):
    for letter, name in FORCES.items():
        extreme, history = quick_ds[f"extreme_{name}"].astype(np.float32), quick_ds[name]
        assert (extreme.sel(extreme=f"max {letter}") >= history.max("time")).all()
        assert (extreme.sel(extreme=f"min {letter}") <= history.min("time")).all()
    assert ((quick_ds["extreme_time"] >= 0) & (quick_ds["extreme_time"] <= 0.4 * (1 + 1e-14))).all()


def test_water_bends_the_members_inwards(quick_ds):
    """Under 4 MPa they are in compression; roof, floor and walls have tension inside in the middle and outside at the ends."""
    start = quick_ds.isel(p0=3, time=0)
    assert (start["axial_force"] < 0).all()
    for member in ("floor", "roof"):
        assert start["bending_moment"].sel(section=f"{member} middle") > 0
        for end in ("left", "right"):
            assert start["bending_moment"].sel(section=f"{member} {end}") < 0


def test_nine_sections_hold_the_five():
    """On the same lines of the mesh the forces are the same bits."""
    five, nine = (swept('p0 = ["4 MPa"]', f"[output]\nsections = {n}\n") for n in (5, 9))
    assert (five.sizes["section"], nine.sizes["section"]) == (20, 36)
    assert len(set(nine["section"].values)) == 36
    assert nine["section"].values[:9].tolist() == [
        f"floor {place}" for place in ("left", "0.125", "0.25", "0.375", "middle", "0.625", "0.75", "0.875", "right")
    ]
    chosen = nine.sel(section=five["section"].values)
    for name in (*FORCES.values(), *(f"extreme_{name}" for name in FORCES.values()), "extreme_time", "section_x", "section_y"):
        np.testing.assert_array_equal(chosen[name], five[name], err_msg=name)


# the joint's work and opening, racking ---------------------------------------------------------------------------------------


def test_opened_length_is_the_open_part_of_the_joint(every_step):
    np.testing.assert_allclose(every_step["opened_length"], 18 * every_step["open_fraction"], rtol=1e-13)  # 2 (5 m + 4 m)
    apart = ((every_step["joint_state"] == 0) * every_step["joint_length"]).sum("joint")
    # sums of the same lengths in another order
    np.testing.assert_allclose(every_step["opened_length"], apart.transpose("p0", "time"), rtol=0, atol=1e-13 * 18)


def test_slip_dissipates_work_and_gives_none_back(every_step):
    work = every_step["slip_work"]
    assert (work.isel(time=0) == 0).all()
    assert (work.isel(time=-1) > 0).all()
    assert (work.diff("time") >= 0).all()


def test_the_work_of_the_joint_is_that_of_its_points(every_step, quick_ds):
    for ds in (every_step, quick_ds):
        apart = (ds["joint_slip_work"] * ds["joint_length"]).sum("joint")
        # the same products, added point by point and step by step
        np.testing.assert_allclose(ds["slip_work"].isel(time=-1), apart, rtol=1e-12)
        assert (ds["joint_slip_work"] >= 0).all()


def test_joint_points_that_are_open_bear_nothing(every_step):
    open_, pressure = every_step["joint_state"] == OPEN, every_step["joint_pressure"]
    assert not pressure.where(open_, 0).any()
    assert (pressure >= 0).all()
    # in single precision
    np.testing.assert_allclose(pressure.max("time"), every_step["max_pressure"], rtol=1e-7)


def test_joint_points_that_stick_keep_their_slip(every_step):
    """Between two steps at both of which a point sticks it slips no further."""
    state, slip = every_step["joint_state"].transpose(..., "time").values, every_step["joint_slip"].transpose(..., "time").values
    stay = (state[..., 1:] == STICK) & (state[..., :-1] == STICK)
    assert stay.any()
    change = np.diff(slip)
    assert not change[stay].any()
    assert change[~stay].any()


def test_racking_ratio_is_that_of_the_histories(every_step):
    """Without the rigid rotation and without the static part, over the free field's."""
    shear = every_step["racking_shear"]
    box = np.abs(shear - shear.isel(time=0)).max("time")
    expected = box / np.abs(every_step["racking_free_field"]).max("time")
    np.testing.assert_allclose(every_step["racking_ratio"], expected, rtol=1e-14)  # one division of the same numbers
    assert (every_step["racking_ratio"] > 0).all()


def test_without_a_motion_there_is_no_racking_ratio():
    ds = swept('record = ["none", "ridgecrest-2019-clc-360.AT2"]')
    assert np.isnan(ds["racking_ratio"].values).tolist() == [True, False]


def test_without_a_horizontal_motion_there_is_no_racking_ratio():
    """What rounding makes of a vertical motion racks no ground."""
    text = SHORT.replace("[mesh]", 'vertical_record = "ridgecrest-2019-clc-up.AT2"\nvertical_peak = "1 m/s**2"\n[mesh]')
    ds = run_study(study_of(text + '[sweep]\nrecord = ["none", "ricker"]\n[ricker]\narrival = "0.2 s"\n'), workers=1)
    assert np.isnan(ds["racking_ratio"].values).tolist() == [True, False]


def test_flexibility_ratio_is_the_engines():
    text = f'{SHORT}[sweep]\nwall = ["0.3 m", "0.5 m"]\nmesh.order = [1, 2]\n'
    ds, study = run_study(study_of(text), workers=1), study_of(text)
    expected = [flexibility_ratio(build_model(spec).system.mesh, spec) for spec in study.cases]
    np.testing.assert_array_equal(ds["flexibility_ratio"].values.ravel(), expected)
    assert ds["flexibility_ratio"].dims == ("wall", "mesh_order")
    assert (ds["flexibility_ratio"].diff("wall") < 0).all()  # thicker walls are stiffer
    assert (ds["flexibility_ratio"].diff("mesh_order") > 0).all()  # three-node triangles too stiff


# mesh ----------------------------------------------------------------------------------------------------------------------


def test_mesh_is_ugrid(reopened):
    mesh = reopened["mesh"].attrs
    assert (mesh["cf_role"], mesh["topology_dimension"]) == ("mesh_topology", 2)
    faces = reopened[mesh["face_node_connectivity"]]
    x, y = (reopened[name] for name in mesh["node_coordinates"].split())
    assert (x.dims, y.dims, faces.dims[0]) == (("node",), ("node",), mesh["face_dimension"])
    assert faces.attrs["cf_role"] == "face_node_connectivity"
    corners = faces.values - faces.attrs["start_index"]
    assert (corners.min(), corners.max()) == (0, reopened.sizes["node"] - 1)
    (x1, x2, x3), (y1, y2, y3) = x.values[corners.T], y.values[corners.T]
    areas = ((x2 - x1) * (y3 - y1) - (x3 - x1) * (y2 - y1)) / 2
    assert (areas > 0).all()
    assert areas.sum() == pytest.approx(20 * 14 - 4 * 3, rel=1e-12)  # the domain less the void


@pytest.mark.parametrize(("name", "location"), [("mesh_layer", "face"), ("shape", "node")])
def test_variables_on_the_mesh_say_so(name, location, reopened):
    """UGRID-1.0 links a variable to its topology by `mesh` and `location`; readers find it by them."""
    assert (reopened[name].attrs.get("mesh"), reopened[name].attrs.get("location")) == ("mesh", location)


def test_layers_of_the_mesh_are_those_of_the_study(reopened):
    y = reopened["mesh_node_y"].values[reopened["mesh_face_nodes"].values].mean(axis=1)
    layer = reopened["mesh_layer"].values
    ground = layer < 5
    assert (layer == 5).sum() == 32
    np.testing.assert_array_equal(layer[ground], np.searchsorted([1, 4, 8, 10], -y[ground]))


def test_joint_nodes_lie_on_each_other(reopened):
    places = np.stack([reopened["mesh_node_x"], reopened["mesh_node_y"]], axis=1)[reopened["joint_nodes"].values]
    np.testing.assert_array_equal(places[:, 0], places[:, 3])
    np.testing.assert_array_equal(places[:, 1], places[:, 2])


# sweeps that change the mesh or the step -------------------------------------------------------------------------------------


@pytest.mark.parametrize("sweep", ['["15 m", "30 m"]', '["30 m", "15 m"]'])
def test_every_case_of_a_mesh_sweep_has_its_own_nodes(sweep):
    """The shape of a case belongs to nodes whose coordinates the dataset holds (DESIGN section 5: the mesh per distinct mesh)."""
    ds = swept(f"domain_width = {sweep}")
    for width in ds["domain_width"].values:
        case = ds.sel(domain_width=width)
        known = np.isfinite(case["shape"]).all("component").values
        x = case["mesh_node_x"].values
        assert np.nanmax(x[known]) == pytest.approx(width / 2, rel=1e-14)
        np.testing.assert_array_equal(np.isfinite(x), known)


@pytest.fixture(scope="module")
def orders():
    """Three-node and six-node triangles side by side, and each alone."""
    return swept("mesh.order = [1, 2]"), [swept(f"mesh.order = [{order}]").isel(mesh_order=0) for order in (1, 2)]


def faces_of(ds):
    """Nodes of the faces that there are, one list each."""
    return [row[row >= 0].astype(int) for row in ds["mesh_face_nodes"].values if row[0] >= 0]


def area_of(ds):
    """Sum of the areas of all faces, by the outline of each; counter-clockwise is positive."""
    x, y = ds["mesh_node_x"].values, ds["mesh_node_y"].values
    areas = [(x[face] * np.roll(y[face], -1) - np.roll(x[face], -1) * y[face]).sum() / 2 for face in faces_of(ds)]
    assert min(areas) > 0
    return sum(areas)


def test_six_node_triangles_are_polygons_of_six_nodes(orders):
    """UGRID-1.0 knows no curved faces: the middle nodes stand between the corners, so that every reader draws them right."""
    both, _ = orders
    for order, corners in ((1, 3), (2, 6)):
        ds = both.sel(mesh_order=order)
        assert {len(face) for face in faces_of(ds)} == {corners}
        assert area_of(ds) == pytest.approx(20 * 14 - 4 * 3, rel=1e-12)  # the domain less the void
    x, y = (ds[f"mesh_node_{name}"].values for name in "xy")
    for face in faces_of(ds):
        for values in (x[face], y[face]):
            np.testing.assert_allclose(values[1::2], (values[::2] + np.roll(values[::2], -1)) / 2, rtol=0, atol=1e-12)


def test_a_sweep_of_orders_is_padded(orders):
    """Each case holds its own nodes, faces, joints and results, and nothing else."""
    both, alone = orders
    assert both["mesh_face_nodes"].dims == ("mesh_order", "face", "corner")
    assert both["joint_nodes"].dims == ("mesh_order", "joint", "joint_corner")
    assert (both.sizes["corner"], both.sizes["joint_corner"]) == (6, 6)
    for i, own in enumerate(alone):
        case = both.isel(mesh_order=i)
        for name in (*SCHEMA, *COORDINATES, "mesh_face_nodes", "joint_nodes", "mesh_layer", "mesh_node_x"):
            if name == "solved_as":  # the number of the case in its study
                continue
            values, expected = case[name].values, own[name].values
            inside = tuple(slice(n) for n in expected.shape)
            np.testing.assert_array_equal(values[inside], expected, err_msg=name)
            outside = np.ones(values.shape, dtype=bool)
            outside[inside] = False
            kind = values.dtype.kind
            blank = np.isnan(values[outside]) if kind == "f" else values[outside] == (-1 if kind == "i" else "")
            assert blank.all(), name


def test_a_sweep_of_orders_survives_netcdf(orders, tmp_path):
    write_dataset(orders[0], tmp_path / "x.nc")
    xr.testing.assert_equal(orders[0], xr.load_dataset(tmp_path / "x.nc", engine="netcdf4"))


@pytest.mark.parametrize(
    "sweep",
    [
        "mesh.order = [2, 1]",
        'wall = ["0.3 m", "0.8 m"]',
        "side_elements = [2, 6]",
        "roof_elements = [4, 6]",
        'box_width = ["5 m", "6 m"]',
    ],
)
def test_sections_keep_their_names_where_the_mesh_is_swept(sweep):
    """The lines of the meshes differ, the names, the members and the ends do not."""
    ds = swept(sweep)
    assert ds["section"].values.tolist() == NAMES
    assert ds["section_member"].dims == ("section",)
    assert ds["section_member"].values.tolist() == [name.rpartition(" ")[0] for name in NAMES]
    for name in (*FORCES.values(), *(f"extreme_{name}" for name in FORCES.values())):
        assert np.isfinite(ds[name]).all()
        assert ds[name].dims == (ds["status"].dims[0], *SCHEMA[name].dims)


def test_places_of_sections_carry_the_axis_where_they_vary():
    ds = swept('wall = ["0.3 m", "0.8 m"]')
    for wall in (0.3, 0.8):
        case = ds.sel(wall=wall)
        assert float(case["section_y"].sel(section="roof middle")) == pytest.approx(-4 - wall / 2, abs=1e-12)
        assert float(case["section_x"].sel(section="right wall top")) == pytest.approx(2.5 - wall / 2, abs=1e-12)
        assert float(case["section_position"].sel(section="floor right")) == pytest.approx(5 - 2 * wall, abs=1e-12)
        assert float(case["section_position"].sel(section="left wall top")) == pytest.approx(4 - 2 * wall, abs=1e-12)


def test_joint_coordinates_carry_the_axis_where_they_vary():
    ds = swept('box_width = ["5 m", "6 m"]')
    for width in (5.0, 6.0):
        assert float(ds["joint_x"].sel(box_width=width).max()) == pytest.approx(width / 2, rel=1e-14)
        assert float(ds["point_x"].sel(box_width=width, point="B")) == pytest.approx(width / 2, rel=1e-14)


def test_joint_is_padded_where_the_number_of_its_points_varies():
    """20 elements: 20 points of one each, or 24 at their nodes, two at a corner (D3)."""
    ds = swept('quadrature = ["one-point", "nodal"]')
    counts = np.isfinite(ds["max_pressure"]).sum("joint")
    assert counts.values.tolist() == [20, 24]
    assert (ds["joint_state"] >= 0).sum("joint").transpose("time", ...).values.tolist() == [[20, 24]] * 21
    assert (ds["shape_state"] >= 0).sum("joint").values.tolist() == [20, 24]
    assert (ds["joint_state"].sel(quadrature="one-point")[:, 20:] == -1).all()


def test_histories_of_several_steps_are_on_the_coarsest_grid():
    ds = swept('dt = ["10 ms", "5 ms"]')
    np.testing.assert_allclose(ds["time"], np.arange(21) * 0.02, rtol=0, atol=1e-15)
    fine = swept('dt = ["5 ms"]')
    own = fine["displacement"].isel(dt=0).sel(time=ds["time"].values, method="nearest")
    np.testing.assert_allclose(ds["displacement"].sel(dt=0.005).values, own.values, rtol=1e-12, atol=1e-18)  # interpolated there
    assert np.isfinite(ds["displacement"]).all()
    for name in SINGLE:
        own = fine[name].isel(dt=0).sel(time=ds["time"].values, method="nearest").values
        # times that rounding moved by a few units of the last place, then single precision
        np.testing.assert_allclose(ds[name].sel(dt=0.005).values, own, rtol=1e-6, atol=1e-12 * abs(own).max(), err_msg=name)


@pytest.mark.parametrize("fine", [5, 4])
def test_joint_states_of_several_steps_are_sampled(fine):
    """Between two states there is none: on the coarser grid stands the last one kept, of that very step where there is one."""
    ds = swept(f'dt = ["10 ms", "{fine} ms"]\np0 = ["0.283 MPa"]').isel(p0=0)
    own = swept(f'dt = ["{fine} ms"]\np0 = ["0.283 MPa"]').isel(dt=0, p0=0)
    assert ds["joint_state"].dtype == np.int8
    kept = round(2 * fine * 1000)  # microseconds, which are whole
    last = [20_000 * k // kept for k in range(21)]
    np.testing.assert_array_equal(ds["joint_state"].isel(dt=1), own["joint_state"].values[last])
    coarse = swept('dt = ["10 ms"]\np0 = ["0.283 MPa"]').isel(dt=0, p0=0)
    np.testing.assert_array_equal(ds["joint_state"].isel(dt=0), coarse["joint_state"])
    assert (coarse["joint_state"] != own["joint_state"].values[last]).any()  # the steps do differ


@pytest.mark.parametrize("sweep", ['["0.2 s", "0.4 s"]', '["0.4 s", "0.2 s"]'])
def test_histories_are_nan_after_a_cases_end(sweep):
    ds = swept(f"duration = {sweep}")
    assert float(ds["time"][-1]) == pytest.approx(0.4, abs=1e-12)
    short, long = ds.sel(duration=0.2), ds.sel(duration=0.4)
    after = ds["time"].values > 0.2 + 1e-9
    for name in ("displacement", "racking", "open_fraction", "slip_work", "base_acceleration", "principal_stress", *SINGLE):
        assert np.isnan(short[name].values[after]).all()
        assert np.isfinite(short[name].values[~after]).all()
        assert np.isfinite(long[name]).all()
    assert (short["joint_state"].values[after] == -1).all()
    assert (short["joint_state"].values[~after] >= 0).all()
    assert (long["joint_state"] >= 0).all()
    assert np.isfinite(ds["peak_racking"]).all()


@pytest.mark.parametrize(("duration", "steps"), [("0.3 s", (0.01, 0.003)), ("0.7 s", (0.01, 0.007)), ("0.6 s", (0.012, 0.004))])
def test_histories_that_end_together_have_no_gap_at_the_end(duration, steps):
    """The last sample of a case is its own end, whatever rounding did to the times."""
    sweep = ", ".join(f'"{step:g} s"' for step in steps)
    text = SHORT.replace('"0.4 s"', f'"{duration}"').replace('dt = "0.01 s"\n', "")
    ds = run_study(study_of(f"{text}[output]\nevery = 1\n[sweep]\ndt = [{sweep}]"), workers=1)
    assert float(ds["time"][-1]) == pytest.approx(float(duration.split()[0]), abs=1e-12)
    assert np.isfinite(ds["racking"]).all()


def test_motions_are_those_of_their_own_case():
    ds = swept('record = ["ridgecrest-2019-clc-360.AT2", "ridgecrest-2019-clc-090.AT2", "none"]')
    assert ds["record"].values.tolist()[-1] == "none"
    peaks = ds["peak_base_acceleration"].sel(component="x")
    assert peaks.values == pytest.approx([1.7085, 1.7085, 0.0], rel=1e-14)
    assert float(np.abs(ds["base_acceleration"][0] - ds["base_acceleration"][1]).max()) > 0.1
    assert not ds["base_acceleration"].sel(record="none").any()


def test_words_and_truth_values_survive_netcdf(tmp_path):
    ds = swept('sides = ["tied", "roller"]\nself_weight = [true, false]')
    write_dataset(ds, tmp_path / "x.nc")
    read = xr.load_dataset(tmp_path / "x.nc", engine="netcdf4")
    assert read["sides"].values.tolist() == ["tied", "roller"]
    assert read["self_weight"].values.tolist() == [True, False]
    assert read["racking"].sel(sides="roller", self_weight=True).dims == ("time",)


def test_a_study_without_a_sweep_has_no_axes(tmp_path):
    ds = run_study(study_of(SHORT), workers=1)
    assert ds["displacement"].dims == SCHEMA["displacement"].dims
    assert ds["status"].shape == ()
    write_dataset(ds, tmp_path / "x.nc")
    xr.testing.assert_equal(ds, xr.load_dataset(tmp_path / "x.nc", engine="netcdf4"))


def test_two_axes_are_two_dimensions():
    ds = swept('p0 = [0, "4 MPa"]\nscale = [0.5, 1, 2]')
    assert ds["racking"].dims == ("p0", "scale", "time")
    peaks = ds["peak_base_acceleration"].sel(component="x")
    np.testing.assert_allclose(peaks, 1.7085 * np.array([0.5, 1, 2]), rtol=1e-14)
    assert peaks.dims == ("scale",)


# failures ------------------------------------------------------------------------------------------------------------------


def test_a_failed_case_is_nan_with_status_and_reason(failing_ds):
    lost = failing_ds.isel(p0=1)
    assert int(lost["status"]) == Status.NO_EQUILIBRIUM
    assert "no static equilibrium" in str(lost["reason"].values)
    for name in set(SCHEMA) - NOT_OF_THE_RESPONSE:
        assert (lost[name] == -1 if name in FLAGS else np.isnan(lost[name])).all(), name
    for name in NOT_OF_THE_RESPONSE - {"status", "reason"}:
        assert np.isfinite(lost[name]).all(), name
    assert float(lost["uplift_over_weight"]) > 1


def test_its_companion_is_untouched(failing_ds):
    kept = failing_ds.isel(p0=0)
    assert int(kept["status"]) == Status.DONE
    assert str(kept["reason"].values) == ""
    alone = run_study(study_of(f"{SHORT}{LOOSE}[sweep]\np0 = [0]"), workers=1).isel(p0=0)
    for name in SCHEMA:
        if alone[name].dtype.kind in "fi":
            np.testing.assert_array_equal(kept[name], alone[name], err_msg=name)


def test_failures_survive_netcdf(failing_ds, tmp_path):
    write_dataset(failing_ds, tmp_path / "x.nc")
    read = xr.load_dataset(tmp_path / "x.nc", engine="netcdf4")
    xr.testing.assert_equal(failing_ds, read)
    named = dict(zip(read["status"].attrs["flag_values"], read["status"].attrs["flag_meanings"].split(), strict=True))
    assert [named[int(status)] for status in read["status"]] == ["done", "no_equilibrium"]
