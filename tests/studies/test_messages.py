"""Malformed study files: every mistake is found at once and told in one line of file, field, value, rule."""

from typing import NamedTuple

import pytest

from studies import StudyError, load_study
from studies.messages import shown

from .conftest import RECORD


class Bad(NamedTuple):
    """A malformed study file, and for each of its mistakes what the line must hold: field, value as written, rule."""

    name: str
    text: str
    told: tuple[tuple[str, str, str], ...]


def bad(name, text, *told):
    return Bad(name, text, told)


LAYER = 'nu = 0.2\nfriction = 0.3\nE = "1 GPa"\ndensity = "2000 kg/m**3"\n'

FILES = [
    # the file's own keys
    bad("title that is a number", "title = 3", ("title", "3", "text in quotes")),
    bad("unknown model", 'model = "coral-2011"', ("model", '"coral-2011"', "coral-2010")),
    bad("model that is a number", "model = 3", ("model", "3", "coral-2010")),
    bad("unknown key", 'modle = "coral-2010"', ("modle", '"coral-2010"', "did you mean model?")),
    bad("unknown table", "[presure]\np0 = 1", ("presure", "{", "did you mean pressure?")),
    bad("field without its table", 'p0 = "2 MPa"', ("p0", '"2 MPa"', "did you mean pressure.p0?")),
    bad("unknown field", '[box]\nwidht = "5 m"', ("box.widht", '"5 m"', "did you mean box.width?")),
    bad("table that is a number", "pressure = 3", ("pressure", "3", "must be a table")),
    bad("table that is a list", "pressure = [1]", ("pressure", "[", "must be a table")),
    # quantities
    bad("no unit", "[pressure]\np0 = 2e6", ("pressure.p0", "2e+06", 'needs a unit, as in "2e+06 Pa"')),
    bad("no unit in quotes", '[pressure]\np0 = "2"', ("pressure.p0", '"2"', "needs a unit")),
    bad("wrong unit", '[pressure]\np0 = "2 cm"', ("pressure.p0", '"2 cm"', "must be a quantity in Pa")),
    bad("unknown unit", '[pressure]\np0 = "2 xyz"', ("pressure.p0", '"2 xyz"', "not known; must be a unit like Pa")),
    bad("no number", '[pressure]\np0 = "high"', ("pressure.p0", '"high"', "must be a number and a unit")),
    bad("decimal comma", '[box]\nwall = "0,5 m"', ("box.wall", '"0,5 m"', "unit")),
    bad("boolean for a quantity", "[pressure]\np0 = true", ("pressure.p0", "true", "must be a number with a unit")),
    bad("list for a quantity", "[pressure]\np0 = [1]", ("pressure.p0", "[", "must be a number with a unit")),
    bad("table for a quantity", "[pressure]\np0 = {a = 1}", ("pressure.p0", "", "must be a number with a unit")),
    bad("date for a quantity", "[pressure]\np0 = 1979-05-27", ("pressure.p0", "1979", "must be a number with a unit")),
    bad("not a number", "[pressure]\np0 = nan", ("pressure.p0", "nan", "must be finite")),
    bad("infinite", "[pressure]\np0 = inf", ("pressure.p0", "inf", "must be finite")),
    bad("infinite in SI", '[domain]\nwidth = "1e300 Gm"', ("domain.width", '"1e300 Gm"', "must be finite")),
    bad("unit on a pure number", '[box]\nnu = "0.2 m"', ("box.nu", '"0.2 m"', "must be")),
    # ranges of single fields
    bad("nu of a fluid", "[box]\nnu = 0.5", ("box.nu", "0.5", "must be less than 0.5")),
    bad("negative nu", "[box]\nnu = -0.1", ("box.nu", "-0.1", "must be 0 or more")),
    bad("no stiffness", '[box]\nE = "0 Pa"', ("box.E", '"0 Pa"', "must be greater than 0")),
    bad("damping of one", "[damping]\nratio = 1.0", ("damping.ratio", "1", "must be less than 1")),
    bad("no time step", '[time]\ndt = "0 s"', ("time.dt", '"0 s"', "must be greater than 0")),
    bad("negative peak", '[motion]\npeak = "-1 m/s**2"', ("motion.peak", '"-1 m/s**2"', "must be greater than 0")),
    bad("shrinking mesh", "[mesh]\ngrowth = 0.5", ("mesh.growth", "0.5", "must be 1 or more")),
    bad("no elements", "[mesh]\nwall_elements = 0", ("mesh.wall_elements", "0", "must be 1 or more")),
    bad("half an element", "[mesh]\nwall_elements = 1.5", ("mesh.wall_elements", "1.5", "must be a whole number")),
    bad("odd number of elements", "[mesh]\nroof_elements = 5", ("mesh.roof_elements", "5", "must be a multiple of 2")),
    bad("text for a whole number", '[mesh]\nwall_elements = "2"', ("mesh.wall_elements", '"2"', "must be a whole number")),
    bad("boolean for a whole number", "[mesh]\nwall_elements = true", ("mesh.wall_elements", "true", "must be a whole number")),
    bad("text for a boolean", '[damping]\njoints = "yes"', ("damping.joints", '"yes"', "must be true or false")),
    bad("number for a boolean", "[gravity]\nself_weight = 1", ("gravity.self_weight", "1", "must be true or false")),
    bad("unknown choice", '[mesh]\nmass = "heavy"', ("mesh.mass", '"heavy"', "'consistent' or 'lumped'")),
    bad("number for a choice", "[supports]\nsides = 1", ("supports.sides", "1", "'tied', 'shear', 'roller' or 'fixed'")),
    bad("one frequency", '[damping]\nfrequencies = ["1 Hz"]', ("damping.frequencies", "", "is missing")),
    bad("three frequencies", '[damping]\nfrequencies = ["1 Hz", "2 Hz", "3 Hz"]', ("damping.frequencies", "[", "at most 2")),
    bad("unstable Newmark", "[time]\nnewmark_beta = 0.2", ("time.newmark_beta", "0.2", "must be at least 0.25")),
    bad("beta too small for gamma", "[time]\nnewmark_gamma = 0.6", ("time.newmark_beta", "0.25", "must be at least 0.3025")),
    # rules between fields
    bad("box deeper than the domain", '[box]\ndepth = "12 m"', ("box.depth", "12 m", "must lie above domain.depth = 14 m")),
    bad("box wider than the domain", '[box]\nwidth = "20 m"', ("box.width", "20 m", "must lie inside domain.width = 20 m")),
    bad("walls without room", '[box]\nwall = "2 m"', ("box.wall", "2 m", "must leave room")),
    bad("box beside the domain", '[box]\noffset = "8 m"', ("box.offset", "8 m", "must lie inside domain.width = 20 m")),
    bad("shorter than a step", '[time]\nduration = "1 ms"', ("time.duration", "0.001 s", "at least one time.dt = 0.005 s")),
    bad("too many steps", '[time]\ndt = "1 us"', ("time.duration", "20 s", "at most two million steps")),
    bad("weight on shear sides", '[supports]\nsides = "shear"', ("supports.sides", '"shear"', "self-weight")),
    # layers
    bad("no layers", "layer = []", ("layer", "[]", "at least 1")),
    bad("layer that is a table", '[layer]\nE = "1 GPa"', ("layer", "", "must be a list")),
    bad(
        "layer without nu and friction",
        '[[layer]]\nbottom = "1 m"\nE = "1 GPa"\ndensity = "2 t/m**3"',
        ("layer.1.nu", "", "is missing"),
        ("layer.1.friction", "", "is missing"),
    ),
    bad(
        "layer with E and G",
        f'[[layer]]\nbottom = "14 m"\nG = "1 GPa"\n{LAYER}',
        ("layer.1", "E and G", "exactly one of E, G, Vs"),
    ),
    bad(
        "layers out of order",
        f'[[layer]]\nbottom = "4 m"\n{LAYER}[[layer]]\nbottom = "2 m"\n{LAYER}',
        ("layer.2.bottom", "2 m", "must lie below the layer above it"),
    ),
    bad(
        "layer with a typing mistake", f'[[layer]]\nbotom = "4 m"\nbottom = "4 m"\n{LAYER}', ("layer.1.botom", '"4 m"', "bottom?")
    ),
    # points
    bad("point with a taken name", '[output.points]\nA = ["1 m", "-1 m"]', ("output.points.A", "", "has already")),
    bad("point outside", '[output.points]\nX = ["99 m", "-1 m"]', ("output.points.X", "[99 m, -1 m]", "must lie in the ground")),
    bad(
        "point in the void", '[output.points]\nX = ["0 m", "-6 m"]', ("output.points.X", "[0 m, -6 m]", "must lie in the ground")
    ),
    bad("point without unit", "[output.points]\nX = [0, -1]", ("output.points.X.2", "-1", "needs a unit")),
    # the sweep
    bad("sweep that is a number", "sweep = 3", ("sweep", "3", "must be a table")),
    bad("empty axis", "[sweep]\np0 = []", ("sweep.p0", "[]", "at least one value")),
    bad("axis of one bare value", '[sweep]\np0 = "1 MPa"', ("sweep.p0", '"1 MPa"', "must be a list")),
    bad("nested list", '[sweep]\np0 = [["1 MPa"]]', ("sweep.p0", "[", "must be a value or a range")),
    bad("unknown axis", "[sweep]\ndamping_ration = [0.05]", ("sweep.damping_ration", "", "did you mean damping.ratio?")),
    bad("axis of several fields", '[sweep]\ndepth = ["1 m"]', ("sweep.depth", "", "depth")),
    bad("axis without unit", '[sweep]\np0 = ["1 MPa", 2]', ("sweep.p0", "2", "needs a unit")),
    bad("value twice", '[sweep]\np0 = ["1 MPa", "1e6 Pa"]', ("sweep.p0", "1e+06 Pa", "twice")),
    bad(
        "field twice",
        '[sweep]\np0 = ["1 MPa"]\npressure.p0 = ["2 MPa"]',
        ("sweep.pressure.p0", "", "pressure.p0 is swept already"),
    ),
    bad("value outside its range", "[sweep]\ndamping_ratio = [0.05, 1.5]", ("sweep.damping_ratio", "1.5", "must be less than 1")),
    bad("values that do not fit", '[sweep]\ndomain_width = ["15 m", "4 m"]', ("sweep.domain_width", "4 m", "must lie inside")),
    bad(
        "axes that do not fit together",
        '[sweep]\ndomain_width = ["15 m", "12 m"]\nbox_width = ["5 m", "13 m"]',
        ("sweep", "13 m", "must lie inside domain.width = 12 m"),
    ),
    bad("layer that is not there", '[sweep]\nlayer.9.E = ["1 GPa"]', ("sweep.layer.9.E", "", "there are 5 layers")),
    bad("layer without its number", '[sweep]\nlayer.N.E = ["1 GPa"]', ("sweep.layer.N.E", "", "")),
    bad(
        "range of a billion",
        '[sweep]\np0 = { from = "0 Pa", to = "1 MPa", num = 1e9 }',
        ("sweep.p0.num", "1e+09", "must be a whole number from 2 to 1,000,000"),
    ),
    bad("range of one", '[sweep]\np0 = { from = "0 Pa", to = "1 MPa", num = 1 }', ("sweep.p0.num", "1", "from 2 to")),
    bad(
        "range without its parts",
        "[sweep]\np0 = {}",
        ("sweep.p0.from", "", "is missing"),
        ("sweep.p0.to", "", "is missing"),
        ("sweep.p0.num", "", "is missing"),
    ),
    bad(
        "range with an unknown part",
        '[sweep]\np0 = { from = "0 Pa", to = "1 MPa", step = 3, num = 3 }',
        ("sweep.p0.step", "", "must be from, to, num or spacing"),
    ),
    bad(
        "range with a wrong spacing",
        '[sweep]\np0 = { from = "1 Pa", to = "1 MPa", num = 3, spacing = "cubic" }',
        ("sweep.p0.spacing", '"cubic"', '"linear" or "log"'),
    ),
    bad(
        "logarithmic range from zero",
        '[sweep]\np0 = { from = 0, to = "1 MPa", num = 3, spacing = "log" }',
        ("sweep.p0", "", "must lie above zero"),
    ),
    bad(
        "range without a unit",
        '[sweep]\np0 = { from = "1 MPa", to = 3, num = 3 }',
        ("sweep.p0.to", "3", "needs a unit"),
    ),
    bad(
        "a billion cases",
        '[sweep]\np0 = { from = 0, to = "1 MPa", num = 1000 }\nscale = { from = 0, to = 1, num = 1000 }\n'
        'dt = { from = "1 ms", to = "9 ms", num = 1000 }',
        ("sweep", "1,000,000,000 cases", "must be at most 1,000,000"),
    ),
    # records
    bad("record that is a number", "[motion]\nrecord = 3", ("motion.record", "3", "must be text in quotes")),
    bad("unknown record", '[motion]\nrecord = "nix.AT2"', ("motion.record", '"nix.AT2"', "no such file beside the study")),
    bad("unknown record in the sweep", '[sweep]\nrecord = ["none", "x.AT2"]', ("motion.record", '"x.AT2"', "no such file")),
    bad("empty name of a record", '[motion]\nrecord = ""', ("motion.record", '""', "no such file")),
    bad("name with a zero byte", '[motion]\nrecord = "a\\u0000b"', ("motion.record", '"a\\x00b"', "no such file")),
    bad(
        "steps of no common multiple",
        '[time]\ndt = "0.0123456789 s"',
        ("motion", "0.0123457 s", "cannot be brought to"),
    ),
    # several at once
    bad(
        "a mistake in every table",
        'titel = "x"\n[box]\nwidht = "5 m"\nnu = 0.7\n[pressure]\np0 = "200 cm"\n[motion]\nrecord = "nix.AT2"\n'
        '[sweep]\np1 = [1]\ndamping_ratio = { from = 0.1, to = "3 m", num = 2 }\n',
        ("titel", '"x"', "did you mean title?"),
        ("box.widht", '"5 m"', "did you mean box.width?"),
        ("box.nu", "0.7", "must be less than 0.5"),
        ("pressure.p0", '"200 cm"', "must be a quantity in Pa"),
        ("motion.record", '"nix.AT2"', "no such file"),
        ("sweep.p1", "", "is not a field"),
        ("sweep.damping_ratio.to", '"3 m"', "must be"),
    ),
    bad(
        "a value of the model and a value of the sweep",
        "[box]\nnu = 0.7\n[sweep]\ndamping_ratio = [1.5]",
        ("box.nu", "0.7", "must be less than 0.5"),
        ("damping_ratio", "1.5", "must be less than 1"),
    ),
    bad(
        "two rules between fields",
        '[box]\ndepth = "12 m"\nwall = "2 m"',
        ("box.depth", "12 m", "must lie above domain.depth"),
        ("box.wall", "2 m", "must leave room"),
    ),
]

RECORDS = [
    ("empty", b"", "NPTS"),
    ("no header", b"1 2 3\n", "NPTS"),
    ("too few values", b"NPTS= 4, DT= .0100 SEC\n1 2 3\n", "holds 3 values, its header says 4"),
    ("too many values", b"NPTS= 2, DT= .0100 SEC\n1 2 3\n", "holds 3 values, its header says 2"),
    ("a word among the values", b"NPTS= 3, DT= .0100 SEC\n1 x 3\n", "'x' is not a number"),
    ("not a number", b"NPTS= 3, DT= .0100 SEC\n1 nan 3\n", "not a number"),
    ("infinite", b"NPTS= 3, DT= .0100 SEC\n1 inf 3\n", "is not finite"),
    ("too large for a float", b"NPTS= 3, DT= .0100 SEC\n1 1e400 3\n", "is not finite"),
    ("too large for a float in SI", b"NPTS= 3, DT= .0100 SEC\n1 1e308 3\n", "is not finite"),
    ("one value", b"NPTS= 1, DT= .0100 SEC\n1\n", "at least two values"),
    ("no time step", b"NPTS= 2, DT= 0 SEC\n1 2\n", "must be above zero"),
    ("binary", bytes(range(256)), "is not text"),
    ("zero throughout", b"NPTS= 3, DT= .0100 SEC\n0 0 0\n", "is zero throughout"),
]


def mistakes_of(path):
    with pytest.raises(StudyError) as caught:
        load_study(path)
    return caught.value.mistakes


@pytest.mark.parametrize("case", FILES, ids=[case.name for case in FILES])
def test_every_mistake_is_one_line_of_file_field_value_rule(case, tmp_path):
    path = tmp_path / "bad.toml"
    path.write_text(case.text)
    lines = mistakes_of(path)
    assert len(lines) == len(case.told), lines
    for field, value, rule in case.told:
        found = [line for line in lines if line.startswith("bad.toml: ") and field in line]
        assert any(value in line and rule in line for line in found), lines
    for line in lines:
        assert "\n" not in line
        assert "None" not in line  # no such word in a study file


@pytest.mark.parametrize(("name", "content", "reason"), RECORDS, ids=[name for name, *_ in RECORDS])
def test_a_broken_record_is_one_line_of_file_field_value_reason(name, content, reason, tmp_path):
    (tmp_path / "broken.AT2").write_bytes(content)
    path = tmp_path / "bad.toml"
    path.write_text('[motion]\nrecord = "broken.AT2"\n')
    (line,) = mistakes_of(path)
    assert line.startswith("bad.toml: motion.record")
    assert "broken.AT2" in line
    assert reason in line


def test_every_record_that_cannot_be_scaled_is_told(tmp_path):
    for name in ("one.AT2", "two.AT2"):
        (tmp_path / name).write_text("NPTS= 3, DT= .0100 SEC\n0 0 0\n")
    path = tmp_path / "bad.toml"
    path.write_text('[sweep]\nrecord = ["one.AT2", "two.AT2"]\n')
    assert len(mistakes_of(path)) == 2


def test_a_record_is_checked_beside_other_mistakes(tmp_path):
    (tmp_path / "broken.AT2").write_text(RECORD.replace("5", "6"))
    path = tmp_path / "bad.toml"
    path.write_text('[motion]\nrecord = "broken.AT2"\n[box]\nnu = 0.7\n')
    assert sorted(line.split(" = ")[0] for line in mistakes_of(path)) == ["bad.toml: box.nu", "bad.toml: motion.record"]


@pytest.mark.parametrize(
    ("value", "text"),
    [
        ("a", '"a"'),
        ("a\nb", '"a\\nb"'),
        (True, "true"),
        (2.0, "2"),
        (2e6, "2e+06"),
        (3, "3"),
        (float("nan"), "nan"),
    ],
)
def test_values_are_shown_as_a_study_file_writes_them(value, text):
    assert shown(value) == text


def test_long_values_are_cut():
    assert shown("x" * 1000) == '"' + "x" * 56 + "..."


def test_error_holds_the_mistakes_as_one_text():
    error = StudyError(["a: b", "c: d"])
    assert str(error) == "a: b\nc: d"
