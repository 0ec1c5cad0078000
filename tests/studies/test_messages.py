"""Malformed study files and records: every mistake is told in one line of file, field, value, rule, and nothing is written."""

import time
from datetime import date

import pytest
from typer.testing import CliRunner

from studies import StudyError, load_study
from studies.__main__ import app
from studies.messages import shown

from .conftest import RECORD, SHORT
from .malformed import FILES, KNET, RECORDS, TABLE, UNIT


def mistakes_of(path):
    with pytest.raises(StudyError) as caught:
        load_study(path)
    return caught.value.mistakes


def told(folder, name="bad.toml"):
    """What `coralquake run` says of a malformed study: its lines on stderr, within two seconds, nothing written, exit code 2."""
    before = sorted(folder.rglob("*"))
    begin = time.process_time()
    outcome = CliRunner().invoke(app, ["run", str(folder / name), "--out", str(folder / "out" / "x.nc")])
    assert time.process_time() - begin < 2.0
    assert (outcome.exit_code, outcome.stdout) == (2, "")
    assert sorted(folder.rglob("*")) == before
    return outcome.stderr.splitlines()


@pytest.mark.parametrize("case", FILES, ids=[case.name for case in FILES])
def test_every_mistake_is_one_line_of_file_field_value_rule(case, tmp_path):
    (tmp_path / "bad.toml").write_text(case.text)
    lines = told(tmp_path)
    assert len(lines) == len(case.told), lines
    for field, value, rule in case.told:
        found = [line for line in lines if line.startswith("bad.toml: ") and field in line]
        assert any(value in line and rule in line for line in found), lines
    for line in lines:
        assert "None" not in line  # no such word in a study file
        assert ".N." not in line.replace("sweep.layer.N.E", "")  # of the catalogue, not of a study file


@pytest.mark.parametrize("case", RECORDS, ids=[case.name for case in RECORDS])
def test_a_broken_record_is_one_line_of_file_field_value_reason(case, tmp_path):
    if case.file.endswith(".EW"):
        pytest.importorskip("obspy")
    (tmp_path / case.file).write_bytes(case.content)
    (tmp_path / "bad.toml").write_text(f'[motion]\nrecord = "{case.file}"\n{case.settings}')
    (line,) = told(tmp_path)
    assert line.startswith(f'bad.toml: motion.record = "{case.file}": ')
    assert case.reason in line


@pytest.mark.parametrize(
    ("raw", "reason"),
    [
        ('title = "é"'.encode("latin-1"), "is not UTF-8 text (byte 9); save it as UTF-8"),
        ('title = "x"'.encode("utf-16"), "is not UTF-8 text"),
        (bytes(range(256)), "is not UTF-8 text"),
        (
            b"[box]\nwidth = 5 m",
            "is not valid TOML: Expected newline or end of document after a statement (at line 2, column 11)",
        ),
        (b"[box]\nwidth = 5,5", "; write decimal points"),
        (b'[box]\nwidth = "5 m', "is not valid TOML: Unterminated string"),
        (b"[box\nwidth = 5", "is not valid TOML: Expected ']'"),
        (b'[sweep]\np0 = ["1 Pa" "2 Pa"]', "is not valid TOML: Unclosed array"),
        (b"[box]\n[box]", "is not valid TOML: Cannot declare"),
        (b'title = "a\x00b"', "is not valid TOML"),
        (b"a = " + b"[" * 5000 + b"]" * 5000, "is nested too deeply"),
        (b"a = " + b"[" * 21 + b"]" * 21, "is nested too deeply"),
        (b"[sweep.p0]\n" + b".".join([b"a"] * 30) + b" = 1", "is nested too deeply"),
        (b"a" + b".a" * 3000 + b" = 1", ""),
        (b"[sweep]\na" + b".a" * 3000 + b" = 1", ""),
        (b"[box]\nnu = 0.2\nnu = 0.3", "is not valid TOML"),
        (b"a = ", "is not valid TOML"),
        (b"#" * 1_000_001, "is larger than 1 MB"),
    ],
    ids=lambda value: repr(value[:24]) if isinstance(value, bytes) else "",
)
def test_a_file_that_is_no_study_is_one_line(raw, reason, tmp_path):
    (tmp_path / "bad.toml").write_bytes(raw)
    (line,) = told(tmp_path)
    assert line.startswith("bad.toml: ")
    assert reason in line


def test_a_folder_and_a_missing_file_are_one_line(tmp_path):
    (tmp_path / "folder.toml").mkdir()
    assert told(tmp_path, "folder.toml") == ["folder.toml: is a folder; name the study file in it"]
    (line,) = told(tmp_path, "Prüfung Hầm.toml")
    assert line.startswith(f'"{tmp_path}/'[:57])
    assert "there is no such file, nor a shipped study of that name (" in line


@pytest.mark.parametrize("raw", [b"\xef\xbb\xbf", b"\xef\xbb\xbf\r\n"], ids=["byte-order mark", "and line ends of Windows"])
def test_a_byte_order_mark_is_no_mistake(raw, tmp_path):
    pytest.importorskip("obspy")
    (tmp_path / "a.csv").write_bytes(raw + TABLE.encode())
    (tmp_path / "a.EW").write_bytes(b"\xef\xbb\xbf" + KNET.encode())
    for name, settings in (("a.csv", UNIT), ("a.EW", "")):
        (tmp_path / "good.toml").write_bytes(raw + f'[motion]\nrecord = "{name}"\n{settings}'.encode())
        assert load_study(tmp_path / "good.toml").motions[name].peak == pytest.approx(0.5, rel=1e-14)


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
        ("Hầm Übung °", '"Hầm Übung °"'),
        ("a\u2028b\u202e\x7f\0", '"a\\u2028b\\u202e\\x7f\\x00"'),
        ("C:\\x", '"C:\\\\x"'),
        (True, "true"),
        (2.0, "2"),
        (2e6, "2e+06"),
        (3, "3"),
        (float("nan"), "nan"),
        (date(1979, 5, 27), "1979-05-27"),
        (["a", 1, True, [2.5]], '["a", 1, true, [2.5]]'),
        ({"from": 0, "to": "1 Pa"}, '{ from = 0, to = "1 Pa" }'),
        ({}, "{}"),
        ([], "[]"),
    ],
)
def test_values_are_shown_as_a_study_file_writes_them(value, text):
    assert shown(value) == text


def test_long_values_are_cut():
    assert shown("x" * 1000) == '"' + "x" * 56 + "..."


def test_error_holds_the_mistakes_as_one_text():
    error = StudyError(["a: b", "c: d"])
    assert str(error) == "a: b\nc: d"


def test_many_values_of_an_axis_with_one_mistake_are_counted():
    """The values that differ in their numbers alone; other axes, other rules and single mistakes are told one by one."""
    lines = [f"f: sweep.p0: pressure.p0 = {i} Pa: must be 0 or more" for i in range(7)]
    others = [
        "f: sweep.p0: box.nu = 1: must be less",
        "f: sweep.layer.1.E: layer.1.E = 1 Pa: no",
        "f: sweep.layer.2.E: layer.2.E = 2 Pa: no",
    ]
    single = [f'f: motion.record = "r{i}": no such file' for i in range(9)]
    found = StudyError([*lines, *others, *single]).mistakes
    assert found == [*lines[:3], "f: sweep.p0: pressure.p0: 4 more like this", *others, *single]


def test_a_sweep_of_many_values_is_refused_soon(tmp_path):
    """A million values are made and compared; the mistake is elsewhere, and the cases are never built."""
    text = '[box]\nnu = 0.7\n[sweep]\np0 = { from = 0, to = "1 MPa", num = 1000000 }\nscale = [1, 2]\n'
    (tmp_path / "bad.toml").write_text(SHORT + text)
    assert told(tmp_path) == [
        "bad.toml: box.nu = 0.7: must be less than 0.5",
        "bad.toml: sweep: makes 2,000,000 cases; must be at most 1,000,000",
    ]
