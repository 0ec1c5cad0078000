"""Batch files: named by their content, whole or set aside; a journal and a manifest that say what happened."""

import json
import os
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from engine import Status
from studies import StudyError, make_study, provenance, run_study
from studies.plan import Batch
from studies.runner import Run
from studies.store import Entry, Names, Store, in_ranges, opened, verified, write_batch

from .conftest import QUICK, RECORD, SHORT, study_of


def names(text, folder=None):
    study = study_of(text, folder)
    return [Names(study).of(batch) for batch in study.batches]


# names ----------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "changed",
    [
        ("num = 3", "num = 2"),
        ("0.4 s", "0.3 s"),
        ("clc-360", "clc-090"),
        ("order = 1", "order = 2"),
        ("[sweep]", "[output]\nevery = 1\n[sweep]"),
        ("[sweep]", "[gravity]\nself_weight = false\n[sweep]"),
    ],
    ids=lambda pair: pair[1],
)
def test_a_name_changes_with_what_decides_the_content(changed):
    assert names(QUICK) == names(QUICK)
    assert not set(names(QUICK)) & set(names(QUICK.replace(*changed)))


def test_a_title_decides_nothing():
    assert names(QUICK) == names(QUICK.replace('"Quick"', '"Other"'))


def test_the_bytes_of_a_record_decide(tmp_path):
    text = SHORT.replace("ridgecrest-2019-clc-360.AT2", "own.AT2")
    found = []
    for record in (RECORD, RECORD.replace("0.1 -0.2", "0.1 -0.3")):
        (tmp_path / "own.AT2").write_text(record)
        found += names(text, tmp_path)
    assert len(set(found)) == 2


def test_versions_sources_and_processor_decide(monkeypatch):
    monkeypatch.setattr(provenance, "computer", provenance.computer.__wrapped__)
    found = {provenance.machine.__wrapped__()}
    for name, other in (("version", lambda package: "0"), ("get_host_cpu_name", lambda: "other"), ("MAKERS", ())):
        with monkeypatch.context() as context:
            context.setattr(provenance, name, other)
            found.add(provenance.machine.__wrapped__())
    assert len(found) == 4


def test_followers_decide():
    """One case marches in both; the other follows by another factor."""
    light = f"{SHORT}[gravity]\nself_weight = false\n[sweep]\nscale = [1]\n"
    both = [names(f'{light}p0 = ["1 MPa"]'), names(f"{SHORT}[gravity]\nself_weight = false\n[sweep]\np0 = [0]\nscale = [1, 2]")]
    both.append(names(f"{SHORT}[gravity]\nself_weight = false\n[sweep]\np0 = [0]\nscale = [1, 4]"))
    assert len({tuple(found) for found in both}) == 3


def test_a_longer_study_has_the_batches_of_the_shorter():
    sweep = "[sweep]\ndamping_ratio = [0.02, {}0.05]\n"
    assert set(names(SHORT + sweep.format(""))) < set(names(SHORT + sweep.format("0.03, ")))


# files ----------------------------------------------------------------------------------------------------------------------


CASES: Mapping = {"time": np.arange(3.0), "racking": np.arange(6.0).reshape(2, 3)}
MODEL: Mapping = {"joint_side": np.array(["floor", "roof"]), "mesh_layer": np.arange(4, dtype=np.int32)}


@pytest.fixture
def batch_file(tmp_path):
    path = tmp_path / "abc.npz"
    write_batch(path, [Status.DONE, Status.NON_FINITE], ["", "too large"], CASES, MODEL)
    return path


def test_a_batch_is_read_as_it_was_written(batch_file):
    assert list(batch_file.parent.iterdir()) == [batch_file]
    with opened(batch_file) as arrays:
        header = arrays.header
        assert (header.name, header.status, header.reason) == ("abc", [0, 5], ["", "too large"])
        for name, values in (CASES | MODEL).items():
            np.testing.assert_array_equal(arrays[name], values)
            assert arrays[name].dtype.str == header.shapes[name][1]
        assert header.shapes["racking"][0] == [3]
        assert header.shapes["time"][0] == [3]
    assert verified(batch_file)


@pytest.mark.parametrize("spoil", ["cut", "empty", "turned", "foreign", "text", "folder"])
def test_what_is_torn_or_foreign_is_set_aside(spoil, batch_file):
    held, whole = Store(batch_file.parent), batch_file.read_bytes()
    assert held.holds("abc")
    if spoil == "folder":
        batch_file.unlink()
        batch_file.mkdir()
    elif spoil == "foreign":
        batch_file.rename(held.path("other"))
        write_batch(batch_file, [0], [""], {}, {})
        batch_file.unlink()
        held.path("other").rename(batch_file.with_name("def.npz"))
        batch_file = batch_file.with_name("def.npz")
    else:
        middle = whole.index(np.arange(6.0).tobytes())
        turned = whole[:middle] + bytes([whole[middle] ^ 1]) + whole[middle + 1 :]
        batch_file.write_bytes({"cut": whole[:-100], "empty": b"", "turned": turned, "text": b"in the way"}[spoil])
    name = batch_file.stem
    for set_aside in ("", "2"):
        assert not held.holds(name)
        assert not held.holds(name)  # it is gone
        assert batch_file.with_name(f"{name}.npz.set-aside{set_aside}").exists()
        batch_file.write_bytes(b"again")


def test_a_batch_that_is_damaged_while_it_is_merged_is_named(batch_file):
    batch_file.write_bytes(batch_file.read_bytes()[:-100])
    with pytest.raises(OSError, match=r"abc[.]npz is damaged"), opened(batch_file):
        pass


# journal and manifest ---------------------------------------------------------------------------------------------------------


def manifest(folder):
    return json.loads((folder / "manifest.json").read_text(encoding="utf-8"))


def test_a_line_that_was_cut_short_spoils_no_other(tmp_path, quick):
    held = Store(tmp_path)
    with held.locked():
        held.note("begun", "a")
        held.note("begun", "b")
    held.journal.write_bytes(held.journal.read_bytes()[:-10])
    with held.locked():
        held.note("begun", "b")
        held.note("ended", "b")
    with held.locked():
        held.write_manifest(quick, [Entry("a", (0, 1, 2)), Entry("b", (3,), (0,), ("",))])
    assert [(entry["file"], entry["executed"]) for entry in manifest(tmp_path)["files"]] == [("a.npz", 1), ("b.npz", 1)]


def test_manifest_says_where_the_cases_are_and_why_they_failed(tmp_path, quick):
    Store(tmp_path).write_manifest(quick, [Entry("a", (0, 2), (0, 4), ("", "no static equilibrium")), Entry("b", (1, 3))])
    assert manifest(tmp_path) == {
        "study": "Quick",
        "cases": 4,
        "batches": 2,
        "files": [
            {
                "file": "a.npz",
                "cases": "1, 3",
                "status": {"done": 1, "no_equilibrium": 1},
                "executed": 0,
                "failed": {"3": "no static equilibrium"},
            },
            {"file": "b.npz", "cases": "2, 4", "status": {"waiting": 2}, "executed": 0},
        ],
    }


@pytest.mark.parametrize(("cases", "words"), [((4,), "5"), (range(16), "1-16"), ((5, 1, 0, 7, 6), "1-2, 6-8")])
def test_ranges(cases, words):
    assert in_ranges(cases) == words


def test_only_one_run_at_a_time(tmp_path):
    with Store(tmp_path).locked(), pytest.raises(StudyError, match="another run is writing here"), Store(tmp_path).locked():
        pass
    with Store(tmp_path).locked():
        assert (tmp_path / "lock").exists()


def test_parts_of_a_killed_run_are_cleared(tmp_path):
    (tmp_path / "abc.npz.123.part").touch()
    with Store(tmp_path).locked():
        assert not list(tmp_path.glob("*.part"))


# runs -----------------------------------------------------------------------------------------------------------------------


HALVES = f"{SHORT}[sweep]\np0 = {{ from = 0, to = '4 MPa', num = 4 }}\n"


def computed(study, folder, batches):
    """A store in which so much is computed."""
    held = Store(folder)
    part = replace_batches(study, batches)
    with held.locked():
        Run(part, held).carried_out(1, None)
    return held


def replace_batches(study, batches):
    """The study with these batches instead of its own."""
    other = replace(study)
    other.__dict__["batches"] = tuple(batches)
    return other


def test_a_batch_whose_parts_are_there_is_made_of_them(tmp_path):
    """As a run leaves it in which the whole one killed its process."""
    study = study_of(HALVES)
    first, second = study.halves(study.batches[0])
    assert (first.cases, second.cases) == ((0, 1), (2, 3))
    held = computed(study, tmp_path, [first, Batch((2,))])
    run = Run(study, held)
    assert [entry.cases for entry in run.entries] == [(0, 1), (2,), (3,)]
    assert (run.n_there, run.steps_left) == (2, 40)


def test_halves_take_their_followers_along():
    study = study_of(f'{SHORT}[gravity]\nself_weight = false\n[sweep]\np0 = ["1 MPa", "2 MPa"]\nscale = [1, 2]\n')
    (batch,) = study.batches
    parts = study.halves(batch)
    assert sorted(case for part in parts for case in part.all_cases) == [0, 1, 2, 3]
    for part in parts:
        assert set(study.scaling.solved_as[list(part.all_cases)]) <= set(part.cases)
    assert study.halves(Batch((0,))) == ()


def test_only_what_is_asked_for_is_kept(tmp_path, batch_file):
    Store(tmp_path).keep_only({"abc"})
    assert batch_file.exists()
    Store(tmp_path).keep_only(set())
    assert not batch_file.exists()


def test_a_study_in_memory_leaves_nothing_behind(tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    run_study(make_study({"motion": {"record": "none"}, "time": {"duration": "0.1 s"}, "mesh": {"order": 1}}), workers=1)
    assert os.listdir(tmp_path) == []
