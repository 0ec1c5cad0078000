"""From a study file to cases and batches: units, ranges, names, order, sharing, and the files themselves."""

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

from engine import LANES, Spec, build_model
from studies import StudyError, load_study, make_study, shipped_studies

from .conftest import QUICK, RECORD, study_of

README = Path(__file__).parents[2] / "README.md"


def axis(written, name="p0"):
    """Values of the first axis of a sweep."""
    return study_of(f"[sweep]\n{name} = {written}").axes[0].values


def mistakes_of(source):
    with pytest.raises(StudyError) as caught:
        load_study(source)
    return caught.value.mistakes


@pytest.mark.parametrize(
    ("text", "section", "field", "value"),
    [
        ('[pressure]\np0 = "200 N/cm**2"', "pressure", "p0", 2e6),
        ('[motion]\npeak = "170.85 cm/s**2"', "motion", "peak", 1.7085),
        ('[motion]\npeak = "0.2 g_0"', "motion", "peak", 0.2 * 9.80665),
        ('[box]\nwidth = "600 cm"', "box", "width", 6.0),
        ('[box]\nE = "34 GPa"', "box", "E", 34e9),
        ('[box]\ndensity = "2.5 t/m**3"', "box", "density", 2500.0),
        ('[box]\ndensity = "2500 kg/m^3"', "box", "density", 2500.0),
        ("[box]\noffset = 0", "box", "offset", 0.0),
        ('[box]\noffset = "-1 m"', "box", "offset", -1.0),
        ('[damping]\nratio = "3 %"', "damping", "ratio", 0.03),
        ('[time]\ndt = "5 ms"', "time", "dt", 0.005),
        ('[time]\nduration = "0.5 min"', "time", "duration", 30.0),
    ],
)
def test_quantities_become_si(text, section, field, value):
    (spec,) = study_of(text).cases
    assert getattr(getattr(spec, section), field) == pytest.approx(value, rel=1e-14)  # one product of floats


def test_layers_replace_those_of_the_preset():
    text = '[[layer]]\nbottom = "14 m"\nnu = 0.2\nfriction = 0.3\nVs = "300 m/s"\nunit_weight = "19.62 kN/m**3"\n'
    (spec,) = study_of(text).cases
    assert len(spec.layer) == 1
    assert spec.layer[0].rho == pytest.approx(2000.0, rel=1e-14)
    assert spec.layer[0].shear_modulus == pytest.approx(2000.0 * 300.0**2, rel=1e-14)


def test_an_empty_file_is_the_reference_problem():
    study = study_of("")
    assert study.cases == (Spec(),)
    assert study.shape == ()
    assert study.label(0) == "the only case"


@pytest.mark.parametrize(
    ("written", "values"),
    [
        ('["1 MPa", "200 N/cm**2", 0]', [1e6, 2e6, 0.0]),
        ('{ from = "1 MPa", to = "3 MPa", num = 3 }', [1e6, 2e6, 3e6]),
        ('{ from = "3 MPa", to = "1 MPa", num = 3, spacing = "linear" }', [3e6, 2e6, 1e6]),
        ('{ from = "1 kPa", to = "1 MPa", num = 4, spacing = "log" }', [1e3, 1e4, 1e5, 1e6]),
        ('{ from = 0, to = "1 MPa", num = 2 }', [0.0, 1e6]),
        ('[0, { from = "1 kPa", to = "100 kPa", num = 3, spacing = "log" }, "1 MPa"]', [0.0, 1e3, 1e4, 1e5, 1e6]),
    ],
)
def test_lists_and_ranges_keep_their_order(written, values):
    assert axis(written) == pytest.approx(values, rel=1e-14)  # powers in floating point


def test_both_ends_of_a_logarithmic_range_are_exact():
    values = axis('{ from = "0.02 MPa", to = "4 MPa", num = 8, spacing = "log" }')
    assert (values[0], values[-1]) == (2e4, 4e6)


def test_ranges_of_whole_numbers_are_whole():
    study = study_of("[sweep]\nwall_elements = { from = 1, to = 3, num = 3 }")
    assert [case.mesh.wall_elements for case in study.cases] == [1, 2, 3]


def test_words_and_truth_values_can_be_swept():
    study = study_of('[sweep]\nsides = ["tied", "roller"]\nself_weight = [true, false]')
    assert [(case.supports.sides, case.gravity.self_weight) for case in study.cases] == [
        ("tied", True),
        ("tied", False),
        ("roller", True),
        ("roller", False),
    ]


@pytest.mark.parametrize(
    ("key", "name", "field"),
    [
        ('p0 = ["1 MPa"]', "p0", "pressure.p0"),
        ('pressure.p0 = ["1 MPa"]', "pressure_p0", "pressure.p0"),
        ('pressure_p0 = ["1 MPa"]', "pressure_p0", "pressure.p0"),
        ("scale = [2]", "scale", "motion.scale"),
        ("damping_ratio = [0.1]", "damping_ratio", "damping.ratio"),
        ('domain_width = ["15 m"]', "domain_width", "domain.width"),
        ('layer.2.E = ["1 GPa"]', "layer_2_E", "layer.2.E"),
        ('[sweep.pressure]\np0 = ["1 MPa"]', "pressure_p0", "pressure.p0"),
        ('[sweep.layer.2]\nE = ["1 GPa"]', "layer_2_E", "layer.2.E"),
    ],
)
def test_keys_of_the_sweep(key, name, field):
    """A key is a short or dotted name; dimensions are called as written, with underscores (DESIGN section 5)."""
    (found,) = study_of(key if key.startswith("[") else f"[sweep]\n{key}").axes
    assert (found.name, *found.settings[0]) == (name, field)


def test_layer_of_a_dotted_key_is_the_one_that_changes():
    study = study_of('[sweep]\nlayer.2.E = ["1 GPa", "2 GPa"]')
    assert [case.layer[1].E for case in study.cases] == [1e9, 2e9]
    assert {case.layer[0] for case in study.cases} == {Spec().layer[0]}


def test_cases_run_through_the_grid_with_the_last_axis_fastest():
    study = study_of('[sweep]\nscale = [1, 2]\np0 = ["1 MPa", "2 MPa", "3 MPa"]\ndamping_ratio = [0.02, 0.05]')
    assert [a.name for a in study.axes] == ["scale", "p0", "damping_ratio"]
    assert study.shape == (2, 3, 2)
    assert len(study.cases) == 12
    for i, case in enumerate(study.cases):
        scale, p0, ratio = np.unravel_index(i, study.shape)
        expected = (study.axes[0].values[scale], study.axes[1].values[p0], study.axes[2].values[ratio])
        assert (case.motion.scale, case.pressure.p0, case.damping.ratio) == expected
    assert study.label(1) == "scale = 1, p0 = 1 MPa, damping_ratio = 0.05"


def test_values_of_several_axes_need_fit_together_in_their_combinations_only():
    study = study_of(
        '[sweep]\ndomain_depth = ["20 m", "30 m"]\n"box.depth" = ["5 m", "12 m"]'
    )  # 12 m + 4 m > 14 m, the preset's depth
    assert [(case.domain.depth, case.box.depth) for case in study.cases] == [(20, 5), (20, 12), (30, 5), (30, 12)]
    assert study.cases == tuple(
        study_of(f'[domain]\ndepth = "{domain} m"\n[box]\ndepth = "{box} m"').cases[0] for domain in (20, 30) for box in (5, 12)
    )


def test_combinations_that_do_not_fit_are_mistakes():
    with pytest.raises(StudyError) as error:
        study_of('[sweep]\ndomain_depth = ["15 m", "30 m"]\n"box.depth" = ["5 m", "12 m"]')
    assert error.value.mistakes == [
        "quick.toml: sweep: box.depth = 12 m: box's floor at 16 m must lie above domain.depth = 15 m",
    ]


def test_of_very_many_mistakes_the_rest_is_counted_only():
    with pytest.raises(StudyError) as error:
        study_of(f"[sweep]\ndamping_ratio = {list(range(2, 5002))}")
    assert len(error.value.mistakes) < 10
    assert error.value.mistakes[-1] == "quick.toml: sweep.damping_ratio: 4,000 more were not looked at"


def test_of_a_study_that_is_wrong_already_ten_thousand_values_are_looked_at():
    with pytest.raises(StudyError) as error:
        study_of('[sweep]\np0 = [{ from = "0 Pa", to = "1 MPa", num = 10_001 }, "1 bogus"]')
    assert error.value.mistakes == [
        "quick.toml: sweep.p0 = \"1 bogus\": unit 'bogus' is not known; must be a unit like Pa",
        "quick.toml: sweep.p0: 1 more were not looked at",
    ]


@pytest.mark.parametrize(
    "sweep",
    [
        'p0 = [0, "1 MPa"]',
        "scale = [1, 2]",
        'peak = ["1 m/s**2", "2 m/s**2"]',
        'record = ["ridgecrest-2019-clc-360.AT2", "ridgecrest-2019-clc-090.AT2", "none"]',
        "self_weight = [true, false]",
        "layer.3.friction = [0.2, 0.4]",
        'reference_height = ["10 m", "14 m"]',
        'p0 = [0, "1 MPa"]\nscale = [1, 2]\nlayer.3.friction = [0.2, 0.4]',
    ],
)
def test_cases_that_differ_in_loads_and_friction_share_a_batch(sweep):
    study = study_of(f"[sweep]\n{sweep}")
    (batch,) = study.batches
    assert batch.cases == tuple(range(len(study.cases)))


@pytest.mark.parametrize(
    "sweep",
    [
        'domain_width = ["15 m", "20 m"]',
        'dt = ["5 ms", "2.5 ms"]',
        'duration = ["10 s", "20 s"]',
        "damping_ratio = [0.02, 0.05]",
        'layer.3.E = ["1 GPa", "2 GPa"]',
        'thickness = ["0.05 m", "0.1 m"]',
        'sides = ["tied", "roller"]',
        "wall_elements = [1, 2]",
        "every = [1, 2]",
    ],
)
def test_cases_that_differ_in_anything_else_do_not(sweep):
    study = study_of(f"[sweep]\n{sweep}")
    assert [batch.cases for batch in study.batches] == [(0,), (1,)]


def test_a_batch_holds_at_most_as_many_cases_as_there_are_lanes():
    study = study_of('[sweep]\np0 = { from = 0, to = "1 MPa", num = 21 }\ndamping_ratio = [0.02, 0.05]')
    assert [len(batch.cases) for batch in study.batches] == [LANES, 21 - LANES, LANES, 21 - LANES]
    assert sorted(case for batch in study.batches for case in batch.cases) == list(range(42))
    for batch in study.batches:
        assert len({study.cases[case].damping.ratio for case in batch.cases}) == 1


def test_ground_is_scaled_to_the_peak_and_lasts_the_duration(quick):
    ground = quick.ground(0)
    assert ground.shape == (41, 2)
    assert np.abs(ground).max(axis=0) == pytest.approx([1.7085, 0.0], rel=1e-14)  # one quotient and one product


def test_a_record_beside_the_study_comes_before_those_shipped(tmp_path):
    (tmp_path / "ridgecrest-2019-clc-360.AT2").write_text(RECORD)
    (tmp_path / "mine.toml").write_text('[time]\nduration = "0.04 s"\ndt = "0.01 s"\n')
    (motion,) = load_study(tmp_path / "mine.toml").motions.values()
    assert len(motion.acceleration) == 5


def test_records_are_found_in_folders_beside_the_study(tmp_path):
    (tmp_path / "motions").mkdir()
    (tmp_path / "motions" / "mine.AT2").write_text(RECORD)
    (tmp_path / "mine.toml").write_text('[motion]\nrecord = "motions/mine.AT2"\n')
    (motion,) = load_study(tmp_path / "mine.toml").motions.values()
    assert motion.peak == pytest.approx(0.2 * 9.80665, rel=1e-14)  # the file is in g


def test_the_vertical_record_shakes_the_vertical_direction():
    text = '[motion]\nvertical_record = "ridgecrest-2019-clc-up.AT2"\nvertical_peak = "0.5 m/s**2"\nscale = 2\n'
    ground = study_of(text).ground(0)
    assert np.abs(ground).max(axis=0) == pytest.approx([3.417, 1.0], rel=1e-14)


def test_no_record_is_no_motion():
    assert not study_of('[motion]\nrecord = "none"\n').ground(0).any()


# files ---------------------------------------------------------------------------------------------------------------------


def test_the_path_gives_name_and_text(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(QUICK)
    study = load_study(path)
    assert (study.name, study.title, study.text) == ("mine", "Quick", QUICK)


def test_without_a_title_the_name_stands_for_it(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text("")
    assert load_study(str(path)).title == "mine"


@pytest.mark.parametrize(
    "raw",
    [
        b"\xef\xbb\xbf" + 'title = "Hầm"'.encode(),
        'title = "Hầm"\r\n'.encode(),
        'title = "Hầm" # no line end'.encode(),
    ],
    ids=["byte-order mark", "Windows line ends", "no line end"],
)
def test_files_of_other_editors_are_read(raw, tmp_path):
    path = tmp_path / "mine.toml"
    path.write_bytes(raw)
    assert load_study(path).title == "Hầm"


@pytest.mark.parametrize("name", ["nix", "nix.toml", "nowhere/p0.toml", "x" * 5000])
def test_a_missing_file_is_told_with_the_shipped_names(name):
    (line,) = mistakes_of(name)
    assert line.startswith(f'"{name[:50]}')
    assert "there is no such file, nor a shipped study of that name (damping, domain_size, grid, p0, paper, scale" in line


# shipped studies -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", shipped_studies())
def test_shipped_studies_load(name):
    study = load_study(name)
    assert study.name == name
    assert study.title
    assert study.cases


def test_p0_is_swept_from_none_to_twice_the_sources():
    study = load_study("p0")
    (found,) = study.axes
    assert (found.name, len(found.values), len(study.batches)) == ("p0", 9, 1)
    assert (found.values[0], found.values[1], found.values[-1]) == (0.0, 2e4, 4e6)
    steps = np.diff(np.log(found.values[1:]))
    assert np.ptp(steps) <= 1e-12  # logarithmic: equal steps to rounding


def test_paper_has_the_sources_mesh():
    """32 structure, 20 joint elements of one point; 132 in the ground, of which the source has 134 (DESIGN section 1)."""
    (spec,) = load_study("paper").cases
    model = build_model(spec)
    mesh = model.system.mesh
    assert (int(mesh.structure.sum()), len(mesh.joints), int((~mesh.structure).sum())) == (32, 20, 132)
    assert len(model.system.points) == 20
    assert (spec.joint.quadrature, spec.joint.thickness_ratio) == ("one-point", 0.1)


def test_paper_keeps_the_sources_numbers():
    """DESIGN section 1, reference problem."""
    (spec,) = load_study("paper").cases
    assert (spec.time.dt, spec.time.duration, spec.damping.ratio, spec.damping.joints) == (0.02, 20.0, 0.05, True)
    assert (spec.pressure.p0, spec.supports.sides, spec.gravity.self_weight) == (2e6, "shear", False)
    assert (spec.domain.width, spec.domain.depth) == (20.0, 14.0)
    assert spec.motion.peak == pytest.approx(1.7085, rel=1e-14)


def test_studies_in_the_readme_are_valid(tmp_path):
    (tmp_path / "site.csv").write_text("t, a\n" + "".join(f"{0.01 * i:.2f}, {100 * (-1) ** i}\n" for i in range(50)))
    blocks = re.findall(r"```toml\n(.*?)```", README.read_text(encoding="utf-8"), re.DOTALL)
    assert blocks
    for block in blocks:
        assert make_study(tomllib.loads(block), folder=tmp_path).cases


def test_damping_and_scale_sweep_nine_values_each():
    damping, scale = load_study("damping"), load_study("scale")
    ratios = [spec.damping.ratio for spec in damping.cases]
    assert len(ratios) == 9
    assert (ratios[0], ratios[-1]) == (0.01, 0.20)
    factors = [spec.motion.scale for spec in scale.cases]
    np.testing.assert_allclose(factors, 0.25 * 2.0 ** (np.arange(9) / 2), rtol=1e-14)  # rounding of the powers
    assert (len(damping.batches), len(scale.batches)) == (9, 1)  # the damping is in the factor, the scale in the load


# motions -------------------------------------------------------------------------------------------------------------------

COLUMN = "".join(f"{value}\n" for value in (0.0, 50.0, -100.0, 50.0, 0.0))
TABLE = "t;a\n" + "".join(f"{0.02 * i:.2f};{value}\n" for i, value in enumerate((0.0, 50.0, -100.0, 50.0, 0.0)))


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "column.txt").write_text(COLUMN)
    (tmp_path / "table.csv").write_text(TABLE)
    return tmp_path


def motion_mistakes(text, folder=None):
    with pytest.raises(StudyError) as caught:
        study_of(text, folder)
    return caught.value.mistakes


def test_text_records_take_step_and_unit_from_the_study(folder):
    text = '[motion]\nrecord = "column.txt"\nvertical_record = "table.csv"\nrecord_dt = "20 ms"\nrecord_unit = "Gal"\n'
    study = study_of(text, folder)
    assert list(study.motions) == ["column.txt", "table.csv"]
    for motion in study.motions.values():
        assert motion.dt == 0.02
        np.testing.assert_allclose(motion.acceleration, [0.0, 0.5, -1.0, 0.5, 0.0], rtol=1e-15)


def test_generated_motions_need_no_file(tmp_path):
    (tmp_path / "ricker").write_text("no record")  # a file of that name is not meant
    text = '[motion]\nrecord = "synthetic"\nvertical_record = "ricker"\nvertical_peak = "0.5 m/s**2"\n[synthetic]\nseed = 3\n'
    study = study_of(text, tmp_path)
    assert not study.motions
    ground = study.ground(0)
    assert ground.shape == (4001, 2)
    assert np.abs(ground).max(axis=0) == pytest.approx([1.7085, 0.5], rel=1e-14)
    assert np.argmax(np.abs(ground[:, 1])) == 200  # the wavelet arrives at 1 s


def test_records_and_generated_motions_can_be_swept_together():
    study = study_of('[sweep]\nrecord = ["synthetic", "ricker", "none", "ridgecrest-2019-clc-360.AT2"]')
    assert list(study.motions) == ["ridgecrest-2019-clc-360.AT2"]
    peaks = [np.abs(study.ground(case)).max() for case in range(4)]
    assert peaks == pytest.approx([1.7085, 1.7085, 0.0, 1.7085], rel=1e-14)


def test_a_missing_record_is_told_with_what_there_is():
    (line,) = motion_mistakes('[motion]\nrecord = "ricket"\n')
    assert line == (
        'quick.toml: motion.record = "ricket": no such file beside the study, nor among those shipped '
        "(ridgecrest-2019-clc-090.AT2, ridgecrest-2019-clc-360.AT2, ridgecrest-2019-clc-up.AT2); "
        "synthetic and ricker are generated"
    )


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('record = "column.txt"\nrecord_unit = "Gal"', 'column.txt": a record of one column needs motion.record_dt'),
        ('record = "table.csv"', 'record = "table.csv": a record of columns of text needs motion.record_unit'),
        ('record_unit = "Gal"', "is a PEER record and states its own time step and unit; leave out motion.record_unit"),
        (
            'vertical_record = "table.csv"\nrecord = "none"\nrecord_unit = "Gal"\nrecord_dt = "0.01 s"',
            'motion.vertical_record = "table.csv": its times step by 0.02 s, motion.record_dt says 0.01 s',
        ),
        (
            'record = "column.txt"\nrecord_unit = "g_0"\nrecord_dt = "0.01 s"',
            "reaches 100 g; no earthquake has been recorded above 5 g; is the unit right?",
        ),
    ],
)  # fmt: skip
def test_a_record_that_cannot_be_used_is_one_mistake(text, message, folder):
    (line,) = motion_mistakes(f"[motion]\n{text}\n", folder)
    assert line.startswith("quick.toml: motion.")
    assert message in line


@pytest.mark.parametrize("sweep", ['record_dt = ["0.01 s", "0.02 s"]', 'record_unit = ["Gal", "m/s**2"]'])
def test_step_and_unit_of_a_record_cannot_be_swept(sweep, folder):
    text = '[motion]\nrecord = "column.txt"\nrecord_unit = "Gal"\nrecord_dt = "0.01 s"\n[sweep]\n'
    (line,) = motion_mistakes(text + sweep, folder)
    assert line.endswith("a record has one time step and one unit; record_dt and record_unit cannot be swept")


def test_a_wrong_motion_table_is_told_without_its_consequences(folder):
    """The record is there; that it cannot be read without the step that is written wrongly is no second mistake."""
    (line,) = motion_mistakes('[motion]\nrecord = "column.txt"\nrecord_unit = "Gal"\nrecord_dt = "soon"\n', folder)
    assert line.startswith('quick.toml: motion.record_dt = "soon"')
    first, second = motion_mistakes('[motion]\nrecord = "other.txt"\nrecord_unit = "g"\n', folder)
    assert "the standard gravity is g_0" in first
    assert "no such file" in second


def test_records_are_read_where_another_table_is_wrong(folder):
    first, second = motion_mistakes('[motion]\nrecord = "table.csv"\n[box]\nwidth = "-1 m"\n', folder)
    assert "box.width" in first
    assert "needs motion.record_unit" in second


def test_a_generator_that_does_not_fit_is_told_before_anything_runs():
    (line,) = motion_mistakes('[motion]\nrecord = "ricker"\n[ricker]\nfrequency = "100 Hz"\n')
    assert line == 'quick.toml: motion.record = "ricker": ricker.frequency = 100 Hz: needs a time.dt of at most 0.0025 s'
