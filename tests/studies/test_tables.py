"""The table and the four sentences say what the dataset holds, for one case and for many."""

import numpy as np
import pytest
import xarray as xr

from engine import Status
from studies import run_study, sentences, table
from studies.messages import in_words
from studies.tables import axes_of, cases_of, failures

from .conftest import LOOSE, SHORT, study_of


@pytest.fixture
def ds(quick_ds):
    """A copy of the quick dataset to write into: pressures 0, 0.02, 0.283 and 4 MPa."""
    return quick_ds.copy(deep=True)


@pytest.fixture(scope="module")
def grid_ds():
    """Two swept fields."""
    return run_study(study_of(SHORT + '[sweep]\np0 = [0, "4 MPa"]\nscale = [0.5, 1]\n'), workers=1)


def one(ds, i):
    """The study of one case, its axis kept."""
    return ds.isel(p0=[i])


def worst(ds, i):
    """Section and extreme at which the bending moment of a case is largest in magnitude, found one by one."""
    case = cases_of(ds).isel(case=i)
    places = [(s, e) for s in range(case.sizes["section"]) for e in range(case.sizes["extreme"])]
    section, extreme = max(places, key=lambda place: abs(float(case["extreme_bending_moment"][place])))
    return case.isel(section=section, extreme=extreme)


def lift(ds, lifted):
    """Set the floor's gap before the shaking of every case."""
    floor = ds["joint_side"].values == "floor"
    for i, up in enumerate(lifted):
        ds["gap_before_shaking"].values[i, floor] = 1e-3 if up else -1e-6


# table ---------------------------------------------------------------------------------------------------------------------


def test_one_row_a_case(quick_ds, grid_ds):
    assert len(table(quick_ds)) == 4
    frame = table(grid_ds)
    assert frame.iloc[:, :2].values.tolist() == [[0, 0.5], [0, 1], [4e6, 0.5], [4e6, 1]]


def test_a_study_without_a_sweep_has_one_row():
    ds = run_study(study_of(SHORT), workers=1)
    assert axes_of(ds) == []
    assert len(table(ds)) == 1


def test_cases_keep_their_order(grid_ds):
    cases = cases_of(grid_ds)
    assert cases["displacement"].dims[0] == "case"
    np.testing.assert_array_equal(cases["displacement"][2], grid_ds["displacement"][1, 0])


@pytest.mark.parametrize(
    ("column", "value"),
    [
        ("p0 [Pa]", lambda ds: ds["p0"]),
        ("status", lambda ds: ds["status"]),
        ("closed before [1]", lambda ds: ds["closed_before_shaking"]),
        ("u_x at A [m]", lambda ds: ds["peak_displacement"].sel(point="A", component="x")),
        ("racking [m]", lambda ds: ds["peak_racking"]),
        ("racking ratio [1]", lambda ds: ds["racking_ratio"]),
        ("opening [m]", lambda ds: ds["max_opening"].max("joint")),
        ("slip [m]", lambda ds: ds["max_slip"].max("joint")),
        ("stress xx at C [Pa]", lambda ds: ds["peak_stress"].sel(point="C", stress_component="xx")),
        ("energy error [1]", lambda ds: ds["energy_error"]),
        ("moment [Nm/m]", lambda ds: xr.DataArray([worst(ds, i)["extreme_bending_moment"] for i in range(4)])),
        ("N then [N/m]", lambda ds: xr.DataArray([worst(ds, i)["extreme_axial_force"] for i in range(4)])),
        ("section", lambda ds: xr.DataArray([str(worst(ds, i)["section"].values) for i in range(4)])),
    ],
)
def test_columns_are_the_datasets_values(column, value, quick_ds):
    np.testing.assert_array_equal(table(quick_ds)[column], value(quick_ds).values)


def test_every_number_of_the_table_names_its_unit(quick_ds):
    assert [name for name in table(quick_ds).columns if not name.endswith("]")] == ["status", "section"]


def test_columns_stand_in_one_order(quick_ds, failing_ds):
    """The axes first, then how the case ended."""
    expected = [
        "p0 [Pa]",
        "status",
        "closed before [1]",
        "u_x at A [m]",
        "racking [m]",
        "racking ratio [1]",
        "opening [m]",
        "slip [m]",
        "moment [Nm/m]",
        "section",
        "N then [N/m]",
        "stress xx at C [Pa]",
        "energy error [1]",
    ]
    assert list(table(quick_ds).columns) == expected
    assert list(table(failing_ds).columns) == expected


@pytest.mark.parametrize("sign", [1, -1])
def test_the_moment_is_the_largest_in_magnitude(sign, ds):
    """Of either sign, with the axial force of its own moment, not the largest one."""
    at = {"p0": 1, "section": 7, "extreme": 4 if sign > 0 else 5}
    ds["extreme_bending_moment"][at] = sign * 1e9
    ds["extreme_axial_force"][at] = -123.0
    row = table(ds).iloc[1]
    assert (row["moment [Nm/m]"], row["section"], row["N then [N/m]"]) == (sign * 1e9, "right wall middle", -123.0)
    others = table(ds).drop(index=1)
    assert (others["moment [Nm/m]"].abs() < 1e9).all()


def test_the_axial_force_beside_the_moment_is_of_that_moment():
    """Against the histories, which keep every step."""
    ds = run_study(study_of(SHORT + "[output]\nevery = 1\n"), workers=1)
    moment = ds["bending_moment"]
    step, section = np.unravel_index(int(np.abs(moment.values).argmax()), moment.shape)
    (row,) = table(ds).to_dict("records")
    assert row["section"] == ds["section"].values[section]
    # histories are in single precision
    assert row["moment [Nm/m]"] == pytest.approx(float(moment[step, section]), rel=1e-7)
    assert row["N then [N/m]"] == pytest.approx(float(ds["axial_force"][step, section]), rel=1e-7)


def test_without_sections_there_is_no_moment():
    """A dataset that holds none has nothing to tell of them."""
    ds = run_study(study_of(SHORT), workers=1)
    bare = ds.isel(section=slice(0, 0))
    (row,) = table(bare).to_dict("records")
    assert np.isnan([row["moment [Nm/m]"], row["N then [N/m]"]]).all()
    assert row["section"] == ""
    assert sentences(bare) == sentences(ds)[:3]


def test_racking_ratio_without_a_free_field_is_not_a_number(ds):
    ds["racking_ratio"].values[1] = np.nan
    assert np.isnan(table(ds)["racking ratio [1]"][1])


def test_a_failed_case_has_its_row(failing_ds):
    frame = table(failing_ds)
    assert frame["status"].tolist() == [0, 4]
    for name in ("racking [m]", "racking ratio [1]", "moment [Nm/m]", "N then [N/m]"):
        assert np.isnan(frame[name]).tolist() == [False, True]
    assert frame["section"].tolist() == [str(worst(failing_ds, 0)["section"].values), ""]


# words ---------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (2e6, "Pa", "2 MPa"),
        (282842.7, "Pa", "0.283 MPa"),
        (20_000.0, "Pa", "0.02 MPa"),
        (5000.0, "Pa", "5 kPa"),
        (500.0, "Pa", "500 Pa"),
        (3.4e10, "Pa", "34 GPa"),
        (-2e6, "Pa", "-2 MPa"),
        (0.0, "Pa", "0"),
        (18.45, "Hz", "18.4 Hz"),
        (0.05, "1", "0.05"),
        (0.05, "", "0.05"),
        (20.0, "m", "20 m"),
        (1.7085, "m/s**2", "1.71 m/s2"),
        (2500.0, "kg/m**3", "2500 kg/m3"),
        ("tied", "", "tied"),
        (np.str_("tied"), "1", "tied"),
        (np.float64(3.0), "m", "3 m"),
        (np.int64(3), "1", "3"),
    ],
)
def test_values_in_words(value, unit, text):
    assert in_words(value, unit) == text


@pytest.mark.parametrize("value", [True, np.True_])
def test_truth_values_are_written_as_in_a_study_file(value):
    assert in_words(value, "1") == "true"


# sentences -----------------------------------------------------------------------------------------------------------------


def test_four_sentences(quick_ds, grid_ds):
    for ds in (quick_ds, grid_ds):
        found = sentences(ds)
        assert len(found) == 4
        assert all(sentence[0].isupper() and sentence.endswith(".") for sentence in found)


def test_the_joint_before_shaking_is_told_at_its_extremes(quick_ds):
    closed = 100 * quick_ds["closed_before_shaking"].values
    assert closed.argmax() == 0
    assert closed.argmin() == 3
    told = sentences(quick_ds)[0]
    assert f"{closed[0]:.0f} % of the joint is closed at p0 = 0 and {closed[3]:.0f} % at p0 = 4 MPa" in told


def test_where_all_cases_close_alike_none_is_singled_out(ds):
    ds["closed_before_shaking"].values[:] = 0.5
    told = sentences(ds)[0]
    assert "50 % of the joint is closed" in told
    assert "closed at p0" not in told


@pytest.mark.parametrize(
    ("lifted", "told"),
    [
        ((False, False, False, False), "the floor bears in every case."),
        ((True, True, True, True), "the floor has lifted in every case."),
        ((False, False, True, True), "the floor has lifted from p0 = 0.283 MPa on."),
        ((False, False, False, True), "the floor has lifted from p0 = 4 MPa on."),
        ((False, True, False, True), "the floor has lifted in 2 of 4 cases."),
        ((True, True, False, False), "the floor has lifted in 2 of 4 cases."),
    ],
)
def test_the_floor_has_lifted_where_its_gaps_are_open(lifted, told, ds):
    lift(ds, lifted)
    assert sentences(ds)[0].endswith(told)


def test_a_floor_that_bears_at_one_point_has_not_lifted(ds):
    lift(ds, (True, True, True, True))
    floor = np.flatnonzero(ds["joint_side"].values == "floor")
    ds["gap_before_shaking"].values[0, floor[2]] = -1e-6
    assert sentences(ds)[0].endswith("the floor has lifted from p0 = 0.02 MPa on.")


def test_the_floor_of_the_quick_study_lifts_between_the_last_two_pressures(quick_ds):
    floor = quick_ds["gap_before_shaking"].values[:, quick_ds["joint_side"].values == "floor"]
    assert (floor > 0).all(axis=1).tolist() == [False, False, False, True]
    assert sentences(quick_ds)[0].endswith("the floor has lifted from p0 = 4 MPa on.")


def test_on_a_grid_of_two_fields_the_lifted_floors_are_counted(grid_ds):
    assert sentences(grid_ds)[0].endswith("the floor has lifted in 2 of 4 cases.")


@pytest.mark.parametrize("side", ["floor", "right wall", "roof", "left wall"])
def test_the_first_slip_is_told_with_time_side_and_case(side, ds):
    ds["first_slip"].values[:] = np.nan
    joint = np.flatnonzero(ds["joint_side"].values == side)[1]
    ds["first_slip"].values[2, joint] = 0.123
    ds["first_slip"].values[3, :] = 0.3
    assert sentences(ds)[1] == f"The first slip comes at 0.12 s on the {side} at p0 = 0.283 MPa; 2 of 4 cases slip."


def test_no_slip_at_all(ds):
    ds["first_slip"].values[:] = np.nan
    assert sentences(ds)[1] == "The joint never slips while it shakes."


def test_racking_is_told_at_its_extremes(quick_ds):
    ratio = quick_ds["racking_ratio"].values
    assert (ratio.argmin(), ratio.argmax()) == (0, 3)
    expected = f"The box racks {ratio[0]:.2g} × as much as the free field at p0 = 0 and {ratio[3]:.2g} × at p0 = 4 MPa."
    assert sentences(quick_ds)[2] == expected


def test_without_a_free_field_there_is_no_racking_to_compare(ds):
    ds["racking_ratio"].values[:] = np.nan
    assert sentences(ds)[2] == "There is no horizontal motion that would rack the free field."


def test_a_single_ratio_is_told_once(ds):
    ds["racking_ratio"].values[1:] = np.nan
    ratio = float(ds["racking_ratio"][0])
    assert sentences(ds)[2] == f"The box racks {ratio:.2g} × as much as the free field at p0 = 0."


def told_of(case, place=""):
    """The sentence about the largest bending moment of a case; forces in kN."""
    found = worst(case, 0)
    moment, axial = (f"{1e-3 * float(found[f'extreme_{name}']):,.0f}" for name in ("bending_moment", "axial_force"))
    section, time = str(found["section"].values), float(found["extreme_time"])
    return f"The largest bending moment is {moment} kNm/m ({section}, {time:.2f} s, N = {axial} kN/m){place}."


def test_the_largest_bending_moment_is_told_with_section_time_axial_force_and_case(quick_ds):
    largest = [abs(float(worst(quick_ds, i)["extreme_bending_moment"])) for i in range(4)]
    assert np.argmax(largest) == 3
    assert sentences(quick_ds)[3] == told_of(one(quick_ds, 3), " at p0 = 4 MPa")


@pytest.mark.parametrize("sign", [1, -1])
def test_a_moment_of_either_sign_may_be_the_largest(sign, ds):
    at = {"p0": 2, "section": 12, "extreme": 4 if sign > 0 else 5}
    for name, value in {"bending_moment": sign * 1.234e9, "axial_force": -5.67e5}.items():
        ds[f"extreme_{name}"][at] = value
    ds["extreme_time"][at] = 0.12
    moment = "1,234,000" if sign > 0 else "-1,234,000"
    assert sentences(ds)[3] == (
        f"The largest bending moment is {moment} kNm/m (roof middle, 0.12 s, N = -567 kN/m) at p0 = 0.283 MPa."
    )


def test_the_largest_moment_of_a_failed_case_is_not_told(ds):
    """It holds none; nor does its place among the cases shift that of the others."""
    ds["status"].values[3] = Status.NOT_CONVERGED
    for name in ("extreme_bending_moment", "extreme_axial_force", "extreme_time"):
        ds[name].values[3] = np.nan
    assert sentences(ds)[3].endswith(" at p0 = 0.283 MPa.")


def test_one_case_is_told_without_its_place(quick_ds):
    case = one(quick_ds, 3)
    closed = 100 * float(case["closed_before_shaking"][0])
    times = case["first_slip"].values[0]
    side = case["joint_side"].values[int(np.nanargmin(times))]
    ratio = float(case["racking_ratio"][0])
    assert sentences(case) == [
        f"Before shaking {closed:.0f} % of the joint is closed and the floor has lifted.",
        f"It first slips at {np.nanmin(times):.2f} s on the {side}.",
        f"The box racks {ratio:.2g} × as much as the free field.",
        told_of(case),
    ]


def test_one_case_whose_floor_bears(quick_ds):
    assert sentences(one(quick_ds, 0))[0].endswith("and the floor bears.")


# sweeps that change the mesh -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("axis", "values"),
    [
        ("quadrature", ('"one-point"', '"nodal"')),
        ("side_elements", ("2", "4")),
        ("domain_width", ('"15 m"', '"20 m"')),
        ("box_width", ('"5 m"', '"6 m"')),
        ("wall", ('"0.3 m"', '"0.5 m"')),
        ("mesh.order", ("1", "2")),
    ],
)
@pytest.mark.parametrize("p0", ["0 Pa", "4 MPa"])
def test_sentences_on_meshes_that_differ_are_those_of_each_mesh_alone(axis, values, p0):
    """Sides and numbers of joint points differ from case to case; what is said of a case does not."""
    text = f'{SHORT.replace("side_elements = 2", "")}[pressure]\np0 = "{p0}"\n[sweep]\n{axis} = '
    both = run_study(study_of(f"{text}[{', '.join(values)}]"), workers=1)
    alone = [run_study(study_of(f"{text}[{value}]"), workers=1) for value in values]
    axis = axis.replace(".", "_")
    before, first, racking, bending = sentences(both)
    lifted = [sentences(ds)[0].endswith("has lifted.") for ds in alone]
    assert before.endswith("the floor has lifted in every case." if p0 == "4 MPa" else "the floor bears in every case.")
    assert set(lifted) == {p0 == "4 MPa"}
    times = [float(ds["first_slip"].min()) for ds in alone]
    soonest = int(np.argmin(times))
    side = sentences(alone[soonest])[1].split(" on the ")[1].rstrip(".")
    assert first.startswith(f"The first slip comes at {times[soonest]:.2f} s on the {side} at {axis} = ")
    assert first.endswith("2 of 2 cases slip.")
    for ds in alone:
        assert f"{float(ds['racking_ratio'][0]):.2g} ×" in racking
    largest = max(alone, key=lambda ds: abs(float(worst(ds, 0)["extreme_bending_moment"])))
    place = f" at {axis} = {in_words(largest[axis].values[0], largest[axis].attrs['units'])}"
    assert bending == told_of(largest, place)


# failures ------------------------------------------------------------------------------------------------------------------


def test_failures_name_the_case_and_the_reason(failing_ds, quick_ds):
    (line,) = failures(failing_ds)
    assert line.startswith("p0 = 4 MPa: no static equilibrium")
    assert failures(quick_ds) == []


def test_sub_steps_are_no_failure(ds):
    ds["status"].values[:] = Status.SUBSTEPS
    assert failures(ds) == []


@pytest.mark.parametrize("status", [s for s in Status if s >= Status.NOT_CONVERGED], ids=lambda s: s.name)
def test_every_other_status_is(status, ds):
    ds["status"].values[1] = status
    assert len(failures(ds)) == 1


def test_a_failed_study_without_a_sweep():
    ds = run_study(study_of(SHORT + LOOSE), workers=1)
    (line,) = failures(ds)
    assert line.startswith("the case: no static equilibrium")
    assert sentences(ds) == ["No case of this study has come to its end."]


def test_failed_cases_are_left_out_of_the_sentences(ds):
    ds["status"].values[3] = Status.NOT_CONVERGED
    for name in ("closed_before_shaking", "gap_before_shaking", "first_slip", "peak_racking"):
        ds[name].values[3] = np.nan
    told = sentences(ds)
    assert "4 MPa" not in " ".join(told)
    assert "of 3 cases slip" in told[1]


def test_the_only_case_that_is_left_is_named(failing_ds):
    """Of several cases one came to its end: the sentences say which."""
    assert "p0 = 0" in sentences(failing_ds)[0]
