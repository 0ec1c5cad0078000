"""What a results file is and what a case does, in lines: everything is named, with its unit, and no number is made up."""

import re
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

from engine import Status, Trace, build_model
from studies import run_study, write_dataset
from studies.batch import trace_case
from studies.schema import COORDINATES, SCHEMA
from studies.show import TRACE_HEAD, show_lines, trace_line

from .conftest import SHORT, study_of

SIZES = SHORT + '[domain_size]\nwidth = { from = "12.8 m", num = 3 }\ndepth = { from = "14 m", num = 3 }\n'


def lines_of(ds, folder):
    """The lines, of the dataset as its file gives it back."""
    write_dataset(ds, folder / "x.nc")
    return list(show_lines(xr.load_dataset(folder / "x.nc", engine="netcdf4")))


@pytest.fixture(scope="module")
def kinds(quick_ds, failing_ds, tmp_path_factory):
    """Datasets of each kind of study and the lines that say what they are."""
    datasets = {
        "sweep": quick_ds,
        "failing": failing_ds,
        "single case": run_study(study_of('title = "One"\n' + SHORT), workers=1),
        "domain size": run_study(study_of(SIZES), workers=1),
        "several axes": run_study(
            study_of(SHORT + '[sweep]\nsides = ["tied", "roller"]\nself_weight = [true, false]\n'), workers=1
        ),
    }
    return {kind: (ds, lines_of(ds, tmp_path_factory.mktemp("show"))) for kind, ds in datasets.items()}


KINDS = ("sweep", "failing", "single case", "domain size", "several axes")


def told_of(lines, word, below=False):
    """What follows a word that one line starts with, above the list of variables or in it."""
    lines = list(lines)
    gap = lines.index("")
    (line,) = [line for line in (lines[gap:] if below else lines[:gap]) if line.split(" ")[0] == word]
    return line.removeprefix(word).strip()


# show ----------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_every_variable_is_listed_with_dimensions_unit_and_meaning(kind, kinds):
    ds, lines = kinds[kind]
    for name in SCHEMA.keys() | COORDINATES.keys():
        attrs = ds[name].attrs
        rest = told_of(lines, name, below=True)
        assert rest.startswith(f"({', '.join(ds[name].dims)}) ")
        unit = attrs.get("units", "")
        assert (f" [{unit}] " in rest) == (unit not in ("", "1"))
        assert f" {attrs['long_name']}" in rest
        assert attrs.get("comment", "") in rest


@pytest.mark.parametrize("kind", KINDS)
def test_all_that_describes_itself_is_listed_once(kind, kinds):
    """And nothing else: between the two gaps there is one line for each variable and coordinate."""
    ds, lines = kinds[kind]
    first, second = (i for i, line in enumerate(lines[: lines.index("study file")]) if not line)
    listed = [line.split(" ")[0] for line in lines[first + 1 : second]]
    described = [name for name, variable in ds.variables.items() if "long_name" in variable.attrs]
    assert sorted(listed) == sorted(described)
    assert {*SCHEMA, *COORDINATES, "mesh", "mesh_face_nodes", "mesh_layer", "joint_nodes"} <= set(listed)


def test_forces_and_works_are_told_with_units_and_signs(kinds):
    lines = kinds["sweep"][1]
    for name, told in {
        "axial_force": "(p0, time, section) [N m-1] axial force N of the sections; tension positive, a metre of the third "
        "dimension",
        "extreme_bending_moment": "(p0, section, extreme) [N m m-1] bending moment M at the moment of each extreme",
        "extreme_time": "(p0, section, extreme) [s] moment of each extreme of the section forces",
        "slip_work": "(p0, time) [J m-1] work dissipated by slip since the static state; a metre of the third dimension",
        "flexibility_ratio": "(p0) flexibility ratio F of the box; its shear strain by itself over the ground's, both under one "
        "shear stress",
        "section_member": "(section) member of the box: floor, right wall, roof, left wall",
    }.items():
        assert told_of(lines, name, below=True) == told


@pytest.mark.parametrize("kind", KINDS)
def test_no_line_holds_what_is_not_there(kind, kinds):
    for line in kinds[kind][1]:
        assert not re.search(r"\bNone\b|\bnan\b|\bNaT\b|\[\]|-0\b(?!\.)|, ,|: $", line), line
        assert line == line.rstrip() or line.startswith("    ")


@pytest.mark.parametrize("kind", KINDS)
def test_provenance_is_that_of_the_file(kind, kinds):
    ds, lines = kinds[kind]
    assert lines[0] == ds.attrs["title"]
    assert ds.attrs["created"] in told_of(lines, "written")
    assert ds.attrs["commit"][:12] in told_of(lines, "written")
    assert "coralquake 0" in told_of(lines, "written")
    for package in ("numpy", "scipy", "numba", "xarray", "netCDF4", "pandas"):
        assert f"{package} " in told_of(lines, "on")
    name, digest = told_of(lines, "records").split(" ")
    assert name == "ridgecrest-2019-clc-360.AT2"
    assert ds.attrs["records_sha256"].split(" ")[1].startswith(digest)
    assert len(digest) == 12


@pytest.mark.parametrize("kind", KINDS)
def test_the_study_file_is_printed_as_it_was_written(kind, kinds):
    ds, lines = kinds[kind]
    written = lines[lines.index("study file") + 1 :]
    assert "\n".join(line.removeprefix("    ") for line in written) == ds.attrs["study"].rstrip("\n")


@pytest.mark.parametrize(
    ("kind", "cases"),
    [
        ("sweep", "4: 4 done"),
        ("failing", "2: 1 done, 1 no equilibrium"),
        ("single case", "1: 1 done"),
        ("domain size", "9: 9 done; 8 solved, the others are one of these times a factor"),  # the first depth is the last width
        ("several axes", "4: 4 done"),
    ],
)
def test_how_the_cases_ended_is_counted(kind, cases, kinds):
    assert told_of(kinds[kind][1], "cases") == cases


def test_axes_are_told_with_their_values(kinds):
    assert told_of(kinds["sweep"][1], "axis") == "p0: 0, 0.02 MPa, 0.283 MPa, 4 MPa (4)"
    assert not [line for line in kinds["single case"][1] if line.startswith("axis")]
    assert [line for line in kinds["several axes"][1] if line.startswith("axis")] == [
        "axis       sides: tied, roller (2)",
        "axis       self_weight: true, false (2)",
    ]
    assert told_of(kinds["domain size"][1], "axis") == (
        "domain: width 12.8 m; width 16 m; width 20 m; depth 14 m; depth 17.5 m; depth 21.88 m; "
        "depth 14 m, record at base; depth 17.5 m, record at base; depth 21.88 m, record at base (9)"
    )


def test_of_many_values_the_first_and_the_last_are_told(quick_ds):
    many = quick_ds.isel(p0=[0] * 30).assign_coords(p0=("p0", np.arange(30.0), quick_ds["p0"].attrs))
    assert told_of(show_lines(many), "axis") == "p0: 0, 1 Pa, 2 Pa, 3 Pa, …, 25 Pa, 26 Pa, 27 Pa, 28 Pa, 29 Pa (30)"


def test_time_and_points_are_told(kinds):
    for _, lines in kinds.values():
        assert told_of(lines, "time") == "0.4 s in 21 steps kept"
    points = "A (0, -4) m, B (2.5, -6) m, C (-2.5, -6) m, D (0, -8) m, S (0, 0) m, F (10, 0) m"
    assert told_of(kinds["sweep"][1], "points") == points
    assert told_of(kinds["domain size"][1], "points") == "A, B, C, D, S, F"  # F stands elsewhere in every width


def test_flags_are_told_with_their_words(kinds):
    state = told_of(kinds["sweep"][1], "joint_state", below=True)
    assert state.endswith("state of the joint points: 0 open, 1 sticking, 2 slipping forward, 3 slipping backward; -1: not there")
    status = told_of(kinds["sweep"][1], "status", below=True)
    assert ", ".join(f"{int(s)} {s.name.lower().replace('_', ' ')}" for s in Status) in status


def test_measures_of_a_domain_size_study_are_told(kinds):
    lines = kinds["domain size"][1]
    for name in ("epsilon", "order", "remaining_error", "within_tolerance"):
        assert told_of(lines, name, below=True).startswith("(domain, measure) ")
    assert told_of(lines, "series", below=True) == "(domain) what grows"


def test_a_study_without_a_file_or_a_record_is_told(tmp_path):
    study = study_of(SHORT.replace("ridgecrest-2019-clc-360.AT2", "none").replace('peak = "1.7085 m/s**2"\n', ""))
    ds = run_study(study, workers=1).assign_attrs(study="")
    lines = lines_of(ds, tmp_path)
    assert told_of(lines, "records") == "none"
    assert "study file" not in lines
    assert lines[-1]


# trace ---------------------------------------------------------------------------------------------------------------------


def step(states=(0, 1, 1, 2, 3, 3), **changes):
    state = SimpleNamespace(contact=SimpleNamespace(state=np.array([states])))
    facts = {"step": 7, "time": 0.07, "state": state, "rounds": 4, "residual": 3.2e-16, "halved": False}
    return Trace(**facts | changes)


@pytest.fixture(scope="module")
def model():
    return build_model(study_of(SHORT).cases[0])


def test_a_step_is_one_line_under_its_head(model):
    line = trace_line(step(), model)
    assert line.split() == ["7", "0.070", "1", "2", "3", "4", "3.2e-16"]
    assert TRACE_HEAD.split() == ["step", "time", "[s]", "open", "stick", "slip", "solves", "residual"]
    assert [match.end() for match in re.finditer(r"\S+", line)] == [
        match.end() for match in re.finditer(r"time \[s\]|\S+", TRACE_HEAD)
    ]


def test_columns_keep_their_places_in_long_runs(model):
    """Up to ten million steps, a thousand joint points."""
    states = np.repeat([0, 1, 2, 3], [1200, 1300, 700, 700])
    line = trace_line(step(step=1_234_567, time=12345.67, states=states, rounds=64, residual=1.5e-13), model)
    assert line.split() == ["1234567", "12345.670", "1200", "1300", "1400", "64", "1.5e-13"]
    assert len(line) == len(TRACE_HEAD)


def test_a_halved_step_says_so(model):
    assert trace_line(step(halved=True), model) == trace_line(step(), model) + "  in sub-steps"


@pytest.mark.parametrize("dt", [0.005, 0.01, 1 / 128, 0.02])
def test_times_are_told_to_a_hundredth_of_the_step(dt):
    """No two steps look alike, and none is told as another."""
    text = SHORT.replace('dt = "0.01 s"', f'dt = "{dt!r} s"').replace('"0.4 s"', '"0.5 s"')
    model = build_model(study_of(text).cases[0])
    size = model.spec.time.dt
    assert size == dt
    for n in (0, 1, 2, 3, 39, 1000, 1001):
        told = float(trace_line(step(step=n, time=n * size), model)[8:18])
        assert told == pytest.approx(n * size, abs=size / 100)


@pytest.mark.parametrize("quadrature", ["nodal", "one-point"])
def test_counts_add_up_to_the_joint_points(quadrature):
    study = study_of(f'{SHORT}[joint]\nquadrature = "{quadrature}"\n[pressure]\np0 = "0.283 MPa"\n')
    lines = []
    trace_case(study, 0, lambda step, model: lines.append(trace_line(step, model)))
    ds = run_study(study, workers=1)
    counts = np.array([[int(word) for word in line.split()[2:5]] for line in lines])
    assert len(counts) == 41
    np.testing.assert_array_equal(counts.sum(axis=1), ds.sizes["joint"])
    state = ds["joint_state"]
    for column, named in enumerate((state == 0, state == 1, state > 1)):
        np.testing.assert_array_equal(counts[::2, column], named.sum("joint"))
    assert (counts.max(axis=0) > 0).all()  # each of the three occurs
