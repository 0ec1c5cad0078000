"""Three hundred mutated studies and records: a study, or lines of file, field, value and rule; no traceback, nothing written."""

import os
import subprocess
import sys
from collections import Counter

import pytest

from studies import StudyError, load_study
from tests.fuzz.mutations import LAID_OUT, REFUSED, SETTINGS, STUDY, STUDY_IS_VALID, Mutant, mutant, record, tried
from tests.studies.conftest import SHORT

SEED, MUTANTS = 1, 300

needs_pipes = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")


@needs_pipes
def test_mutants_are_studies_or_refused_in_lines(tmp_path):
    ended: Counter = Counter()
    findings = []
    for number in range(MUTANTS):
        (tmp_path / str(number)).mkdir()
        end, wrong = tried(mutant(SEED, number), tmp_path / str(number))
        ended[end] += 1
        findings += [f"mutant {number}: {line}" for line in wrong]
    assert findings == []
    assert ended[REFUSED] > 0.8 * MUTANTS
    assert ended[STUDY_IS_VALID] > 0


def test_a_mutant_is_decided_by_its_seed_and_number():
    assert mutant(1, 7) == mutant(1, 7)
    assert len({mutant(1, number).files[STUDY] for number in range(50)}) > 40


@pytest.mark.parametrize("name", SETTINGS)
def test_without_a_mutation_it_is_a_study(name, tmp_path):
    if name == "a.EW":
        pytest.importorskip("obspy")
    (tmp_path / name).write_bytes(record(name))
    text = LAID_OUT.replace('"a.AT2"', f'"{name}"').replace("[motion]\n", f"[motion]\n{SETTINGS[name]}")
    (tmp_path / STUDY).write_text(text)
    assert len(load_study(tmp_path / STUDY).cases) == 10


# ---- what mutants have found, in its smallest form ----

FOUND = {
    "whole number of 5000 figures": (f"a = {'1' * 5000}", "holds a whole number of more than 4300 figures"),
    "hexadecimal number of 5000 figures": (f"[mesh]\nwall_elements = 0x{'f' * 5000}", "mesh.wall_elements = 0xfff"),
    "whole number of 400 figures": (f"[mesh]\nwall_elements = 1{'0' * 400}", "mesh.wall_elements = 1000"),
    "layer of 5000 figures": (f"[sweep]\nlayer.{'1' * 5000}.E = ['1 Pa']", "sweep.layer.111"),
    "key with a line end": ('"a\\nb" = 1', "a\\nb = 1: is not a table of a study"),
    "field that clears the terminal": ('[box]\n"\\u001b[2J" = 1', "box.\\x1b[2J = 1: is not a field"),
    "swept key with a line end": ('[sweep]\n"a\\nb" = [1]', "sweep.a\\nb: is not a field"),
    "key of 900,000 characters": (f"{'a' * 900_000} = 1", f"{'a' * 57}... = 1: is not a table of a study"),
    "line of equal signs": ("=" * 900_000, "is not valid TOML: Invalid statement"),
    "dotted key of 450,000 parts": (f"{'.'.join('a' * 450_000)} = 1", "is nested too deeply for a study"),
    "dotted key of 450,000 parts in a table": (f"x = {{ {'.'.join('a' * 450_000)} = 1 }}", "is nested too deeply for a study"),
    "60,000 unknown keys": ("\n".join(f"k{i} = 1" for i in range(60_000)), "holds 60,000 keys and tables; must be at most 2,000"),
    "90,000 empty layers": ("[[layer]]\n" * 90_000, "keys and tables; must be at most 2,000"),
    "one value 15,000 times": (f"{SHORT}[sweep]\nscale = [{'1, ' * 15_000}]", "sweep.scale: holds 1 twice"),
    "20,000 wrong values": (
        f'{SHORT}[sweep]\nbox_width = {{ from = "-2 m", to = "-1 m", num = 20000 }}',
        "sweep.box_width: 19,000 more were not looked at",
    ),
}


@pytest.mark.parametrize(("text", "said"), FOUND.values(), ids=FOUND)
@needs_pipes
def test_a_finding_in_a_study_is_lines(text, said, tmp_path):
    found = Mutant({STUDY: text.encode()}, ())
    assert tried(found, tmp_path) == (REFUSED, [])
    with pytest.raises(StudyError) as caught:
        load_study(tmp_path / "a" / "b" / STUDY)
    assert any(said in line for line in caught.value.mistakes), caught.value.mistakes


UNIT = 'record_unit = "cm/s**2"\n'
RECORDS = {
    "word of 200,000 figures": ("a.AT2", f"NPTS= 1, DT= .01 SEC\n{'1' * 200_000}x\n", "is not a number"),
    "number of 2000 figures": ("a.csv", f"0.{'0' * 2000}1 2\n", "line 1: is longer than 1,000 characters"),
    "line of six million columns": ("a.csv", "1 2\n" + "11 " * 6_000_000, "line 2: is longer than 1,000 characters"),
    "first line of six million columns": ("a.csv", "11 " * 6_000_000, "line 1: is longer than 1,000 characters"),
    "steps of 1e-320 s": ("a.csv", "0 1\n1e-320 2\n2e-320 3\n", "is its time in seconds?"),
    "six million values": ("a.AT2", "NPTS= 3, DT= .01 SEC\n" + "11 " * 6_000_000, "holds 6000000 values, its header says 3"),
    "six million values as said": ("a.AT2", "NPTS= 6000000, DT= .01 SEC\n" + "11 " * 6_000_000, "at most 2,000,000"),
}


@pytest.mark.parametrize(("name", "text", "said"), RECORDS.values(), ids=RECORDS)
@needs_pipes
def test_a_finding_in_a_record_is_a_line(name, text, said, tmp_path):
    settings = UNIT if name == "a.csv" else ""
    study = f'[motion]\nrecord = "{name}"\n{settings}'
    found = Mutant({STUDY: study.encode(), name: text.encode()}, ())
    assert tried(found, tmp_path) == (REFUSED, [])
    with pytest.raises(StudyError, match=r"motion\.record") as caught:
        load_study(tmp_path / "a" / "b" / STUDY)
    assert said in caught.value.mistakes[0]


def test_a_k_net_record_that_overflows_and_one_of_long_lines(tmp_path):
    pytest.importorskip("obspy")
    study = b'[motion]\nrecord = "a.EW"\n'
    for old, new in ((b"1000(gal)/1000", b"1e300(gal)/1e-300"), (b"       50", b"1" * 30_000 + b"x")):
        folder = tmp_path / str(len(new))
        folder.mkdir()
        found = Mutant({STUDY: study, "a.EW": record("a.EW").replace(old, new, 1)}, ())
        assert tried(found, folder) == (REFUSED, [])


@needs_pipes
@pytest.mark.parametrize("place", ["/dev/zero", "/dev/full", "/dev/stdin", "pipe"])
def test_a_device_or_a_pipe_is_no_study(place, tmp_path):
    os.mkfifo(tmp_path / "pipe")
    answer = subprocess.run(
        [sys.executable, "-m", "studies", "check", place if place[0] == "/" else tmp_path / place],
        input="",
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert (answer.returncode, answer.stdout) == (2, "")
    assert answer.stderr.splitlines() == [f"{place.rpartition('/')[2]}: is a device or a pipe; name a study file"]


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere names of files are text")
def test_names_that_are_no_text_are_told_before_anything_runs(tmp_path):
    (tmp_path / "a\udcff.toml").write_text(SHORT)
    with pytest.raises(StudyError, match=r"a\\udcff.toml: its name is not text"):
        load_study(tmp_path / "a\udcff.toml")
    (tmp_path / "a.toml").write_text(SHORT)
    command = [sys.executable, "-m", "studies", "run", tmp_path / "a.toml", "--out", os.fsencode(tmp_path / "b\udcff.nc")]
    answer = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert answer.returncode == 2
    assert answer.stderr.splitlines() == [f"{tmp_path}/b\\udcff.nc: its name is not text (UTF-8); choose another with --out"]
    assert [path.name for path in tmp_path.glob("b*")] == []
