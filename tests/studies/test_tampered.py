"""Results and batch files, damaged or forged: one line and exit code 2, or computed anew; nothing in them is executed."""

import json
import os
import pickle
import zipfile
import zlib
from collections import Counter
from io import BytesIO
from pathlib import Path

import netCDF4
import numpy as np
import pytest
from typer.testing import CliRunner

from engine import Status
from studies import make_study, probe
from studies.__main__ import app
from studies.messages import StudyError
from studies.rerun import rerun
from studies.runner import run_into
from studies.store import Store, opened, verified, write_batch

from .conftest import QUICK, SHORT, study_of

BRIEF = {"time": {"dt": "0.01 s", "duration": "0.1 s"}, "mesh": {"order": 1, "corner_levels": 0}}

READ = ("show", "table", "plot", "rerun")


def unwatched(run):
    return lambda steps: None


@pytest.fixture(scope="module")
def original(tmp_path_factory):
    """Results of four cases, with their record."""
    path = tmp_path_factory.mktemp("results") / "quick.nc"
    run_into(path, study_of(QUICK), 1, unwatched)
    return path.read_bytes()


@pytest.fixture
def results(original, tmp_path):
    path = tmp_path / "x.nc"
    path.write_bytes(original)
    return path


def refused(path, commands=READ):
    """The one line that each of the commands says, the same for all; nothing is written."""
    before = sorted(path.parent.rglob("*"))
    said = set()
    for command in commands:
        outcome = CliRunner().invoke(app, [command, str(path)])
        assert (outcome.exit_code, outcome.stdout) == (2, ""), (command, outcome.exception)
        (line,) = outcome.stderr.splitlines()
        lead, _, mistake = line.partition("x.nc: ")
        assert lead in ("", f"{path.parent}{os.sep}")
        assert line.isprintable()
        said.add(mistake)
    assert sorted(path.parent.rglob("*")) == before
    assert len(said) == 1
    return said.pop()


class Trap:
    """What would make a folder, were it unpickled."""

    def __init__(self, place):
        self.place = str(place)

    def __reduce__(self):
        return os.mkdir, (self.place,)


# results --------------------------------------------------------------------------------------------------------------------


def without(name):
    def change(file):
        file.renameVariable(name, "gone")

    return change


def of_another_shape(file):
    file.renameVariable("racking", "gone")
    file.createVariable("racking", "f8", ("time", "p0"))


def of_another_kind(file):
    file.renameVariable("status", "gone")
    file.createVariable("status", str, ("p0",))


def with_attribute(name, value, of=""):
    def change(file):
        (file[of] if of else file).setncattr(name, value)

    return change


def of_terabytes(file):
    file.createDimension("huge", 10**12)
    file.createVariable("huge", "f8", ("huge",), zlib=True, chunksizes=(10**6,))


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (without("status"), "was not written by coralquake"),
        (without("racking"), "holds no racking"),
        (without("p0"), "no values or no unit along p0"),
        (without("point"), "does not name A, C along point"),
        (of_another_shape, "holds racking with other dimensions"),
        (of_another_kind, "holds status with other dimensions, or of another kind"),
        (of_terabytes, "says to hold 8,000,000"),
        (with_attribute("title", 3.0), "has no text title"),
        (with_attribute("study", np.arange(3)), "has no text study"),
        (with_attribute("units", 2.0, of="p0"), "no unit along p0"),
        (with_attribute("long_name", 2.0, of="racking"), "says of racking what is no text"),
        (with_attribute("units", "days since the flood", of="time"), "is not a netCDF file that can be read"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_what_is_not_as_it_is_written_here_is_one_line(change, reason, results):
    with netCDF4.Dataset(results, "a") as file:
        change(file)
    assert reason in refused(results)


def test_a_status_that_there_is_not_is_one_line(results):
    with netCDF4.Dataset(results, "a") as file:
        file["status"][1] = 77
    assert "holds a status that there is not" in refused(results)


def test_places_that_are_none_are_not_drawn(results):
    with netCDF4.Dataset(results, "a") as file:
        file["mesh_node_y"][:] = np.nan
    assert "holds what cannot be drawn" in refused(results, ["plot"])


def test_a_pickle_in_place_of_results_is_one_line_and_stays_one(tmp_path):
    (tmp_path / "x.nc").write_bytes(pickle.dumps(Trap(tmp_path / "sprung")))
    assert refused(tmp_path / "x.nc") == "is not a netCDF file that can be read"
    assert not (tmp_path / "sprung").exists()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="each file is read in a process of its own, lest HDF5 crash in this one")
def test_no_bit_that_turns_changes_a_number_quietly(original, tmp_path):
    """Of the values, which are packed with their checksums; in the names and attributes it may."""
    path, rng = tmp_path / "x.nc", np.random.default_rng(1)
    good = _in_a_process(original, path)
    assert good is not None
    found = Counter()
    for place in rng.integers(len(original), size=16):
        raw = bytearray(original)
        raw[place] ^= 1 << rng.integers(8)
        ended = _in_a_process(bytes(raw), path)
        assert ended in (good, b"refused"), f"bit of byte {place}"
        found[ended] += 1
    assert found[good] > 0
    assert found[b"refused"] > 0


def _in_a_process(raw, path):
    """Digest of all numbers in a file of these bytes, b"refused", or None where the process crashed."""
    path.write_bytes(raw)
    answer, end = os.pipe()
    child = os.fork()
    if not child:
        said = b"failed"
        try:
            from studies.results import read_results

            ds = read_results(path)
            numbers = (ds[name].values.tobytes() for name in sorted(map(str, ds.variables)) if ds[name].dtype.kind in "fi")
            said = str(zlib.crc32(b"".join(numbers))).encode()
        except StudyError:
            said = b"refused"
        finally:
            os.write(end, said)
            os._exit(0)
    os.close(end)
    with os.fdopen(answer, "rb") as told:
        said = told.read()
    os.waitpid(child, 0)
    return said or None


def reading_does(deed, folder, monkeypatch):
    """Let every reading of a file do this: on which files HDF5 crashes changes with its version."""
    script = folder / "deed.py"
    script.write_text(f"import os, signal, time\n{deed}\n")
    monkeypatch.setattr(probe, "__file__", str(script))


CRASH = "os.kill(os.getpid(), signal.SIGSEGV)"


@pytest.mark.skipif(os.name == "nt", reason="no such signal")
def test_where_the_library_crashes_the_reader_does_not(results, monkeypatch):
    reading_does(CRASH, results.parent, monkeypatch)
    assert refused(results) == "is damaged: the HDF5 library crashes on it"


def test_where_the_library_does_not_end_the_reader_does(results, monkeypatch):
    reading_does("time.sleep(100)", results.parent, monkeypatch)
    monkeypatch.setattr(probe, "PATIENCE", 0.2)
    assert refused(results, ["show"]) == f"is damaged: it is not read within {0.2 + len(results.read_bytes()) / 2**20:.0f} s"


@pytest.mark.skipif(os.name == "nt", reason="no such signal")
def test_results_on_which_the_library_crashes_are_made_anew(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("short.toml").write_text(SHORT)
    made = [made_at("short.toml") for _ in range(2)]
    reading_does(CRASH, tmp_path, monkeypatch)
    made.append(made_at("short.toml"))
    assert made[0] == made[1] < made[2]


def made_at(study):
    """When the results of a study were written, after it has been run."""
    assert CliRunner().invoke(app, ["run", study]).exit_code == 0
    return Path("results/short.nc").stat().st_mtime_ns


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("[box", "its study text is not valid TOML"),
        (f"a = {'1' * 5000}", "more than 4300 figures"),
        ("\n".join(f"k{i} = 1" for i in range(3000)), "holds 3,000 keys and tables"),
        ("#" * 1_000_001, "is larger than 1 MB"),
        (f"{SHORT}[sweep]\np0 = {{ from = 0, to = '1 Pa', num = 1000000 }}\nscale = [1, 2]", "makes 2,000,000 cases"),
        (f'{SHORT}[sweep]\np0 = ["1 Pa", "2 Pa"]', "holds 4 cases, its study text makes 2"),
        (QUICK.replace("ridgecrest-2019-clc-360.AT2", "/etc/passwd"), "/etc/passwd"),
        (QUICK.replace("ridgecrest-2019-clc-360.AT2", "/dev/zero"), "/dev/zero"),
        (QUICK.replace("[motion]", '[output]\nfile = "../../x"\n[motion]'), "output.file"),
    ],
)
def test_a_study_text_that_was_changed_is_one_line(text, reason, results):
    with netCDF4.Dataset(results, "a") as file:
        file.study = text
    assert reason in refused(results, ["rerun"])


@pytest.mark.parametrize(
    "change",
    [
        lambda record: record.__setitem__(0, np.nan),
        lambda record: record.setncattr("dt", 1e-320),
        lambda record: record.setncattr("dt", "often"),
        lambda record: record.delncattr("dt"),
        lambda record: record.__setitem__(0, 1.0),
    ],
    ids=["not a number", "no step", "step of text", "step missing", "another value"],
)
def test_a_record_that_was_changed_is_one_line(change, results):
    with netCDF4.Dataset(results, "a") as file:
        change(file["records/record_1"])
    refused(results, ["rerun"])


def test_a_record_of_terabytes_is_one_line(results):
    with netCDF4.Dataset(results, "a") as file:
        of_terabytes(file["records"])
    assert "says to hold 8,000,000" in refused(results)


def test_a_study_name_leads_nowhere_and_what_steers_a_terminal_is_escaped(results):
    with netCDF4.Dataset(results, "a") as file:
        file.setncatts({"study_name": "../../elsewhere", "title": "a\x1b[2Jb\nc\x07"})
    before = sorted(results.parent.parent.rglob("*"))
    assert rerun(results, 1, unwatched).agrees
    for command in ("show", "table"):
        outcome = CliRunner().invoke(app, [command, str(results)])
        assert outcome.exit_code == 0
        assert all(line.isprintable() for line in outcome.stdout.split("\n"))
    assert sorted(results.parent.parent.rglob("*")) == before


# batch files ----------------------------------------------------------------------------------------------------------------


@pytest.fixture
def batch(tmp_path):
    path = tmp_path / "abc.npz"
    write_batch(path, [Status.DONE, Status.DONE], ["", ""], {"time": np.arange(3.0), "racking": np.ones((2, 3))}, {})
    return path


def repacked(path, packing=zipfile.ZIP_STORED, **entries):
    """The batch file with other entries, all checksums right."""
    with zipfile.ZipFile(path) as before:
        held = {name: before.read(name) for name in before.namelist()}
    with zipfile.ZipFile(path, "w", packing) as after:
        for name, raw in (held | entries).items():
            after.writestr(name, raw)


def npy(array, **options):
    raw = BytesIO()
    np.save(raw, array, **options)
    return raw.getvalue()


def header(**said):
    whole = {"name": "abc", "status": [0, 0], "reason": ["", ""], "shapes": {"time": [[3], "<f8"]}} | said
    return npy(np.frombuffer(json.dumps(whole).encode(), np.uint8))


ABSURD = npy(np.zeros(3)).replace(b"(3,)", b"(999999999999999999,)", 1)


@pytest.mark.parametrize(
    "entries",
    [
        {"header.npy": header(status=["x", 0])},
        {"header.npy": header(status=[0, 77])},
        {"header.npy": header(reason=[])},
        {"header.npy": header(reason=[1, 2])},
        {"header.npy": header(shapes={"gone": [[3], "<f8"]})},
        {"header.npy": header(shapes={"time": [[4], "<f8"]})},
        {"header.npy": header(shapes=[1])},
        {"header.npy": header(more=1)},
        {"header.npy": npy(np.frombuffer(b"[" * 100_000, np.uint8))},
        {"header.npy": ABSURD},
        {"time.npy": ABSURD},
        {"time.npy": b""},
        {"racking.npy": npy(np.ones((2, 3), dtype=np.float32))},
    ],
    ids=lambda entries: next(iter(entries)),
)
def test_a_forged_batch_is_set_aside(entries, batch):
    assert verified(batch)
    repacked(batch, **entries)
    assert not Store(batch.parent).holds("abc")
    assert [path.name for path in batch.parent.iterdir()] == ["abc.npz.set-aside"]


def test_a_packed_batch_is_set_aside_before_it_is_unpacked(batch):
    repacked(batch, zipfile.ZIP_DEFLATED, **{"bomb.npy": bytes(50_000_000)})
    with pytest.raises(OSError, match="is packed"), opened(batch):
        pass
    assert not Store(batch.parent).holds("abc")


def test_nothing_in_a_batch_is_unpickled(batch, tmp_path):
    trapped = npy(np.array([Trap(tmp_path / "sprung")], dtype=object), allow_pickle=True)
    repacked(batch, **{"time.npy": trapped, "header.npy": header(shapes={"time": [[1], "|O"]})})
    assert not verified(batch)
    repacked(batch, **{"header.npy": trapped})
    assert not verified(batch)
    batch.write_bytes(pickle.dumps(Trap(tmp_path / "sprung")))
    assert not verified(batch)
    assert not (tmp_path / "sprung").exists()
    pickle.loads(pickle.dumps(Trap(tmp_path / "sprung")))  # the trap does work
    assert (tmp_path / "sprung").exists()


def test_names_in_an_archive_lead_nowhere(batch):
    repacked(batch, **{"../../outside.npy": npy(np.zeros(3)), "/outside.npy": npy(np.zeros(3))})
    before = sorted(batch.parent.parent.rglob("*"))
    with opened(batch) as arrays:
        assert arrays["racking"].shape == (2, 3)
    assert sorted(batch.parent.parent.rglob("*")) == before


def test_a_forged_batch_is_computed_anew_and_a_forged_journal_passed_over(tmp_path):
    study, path = (
        make_study({"time": {"dt": "0.01 s", "duration": "0.1 s"}, "mesh": {"order": 1, "corner_levels": 0}}),
        tmp_path / "x.nc",
    )
    run_into(path, study, 1, unwatched)
    folder = Store.beside(path).folder
    (batch,) = folder.glob("*.npz")
    whole = batch.read_bytes()
    repacked(batch, **{"racking.npy": npy(np.array([Trap(tmp_path / "sprung")], dtype=object), allow_pickle=True)})
    (folder / "journal.jsonl").write_bytes(
        b'not JSON\n{"event": []}\n' + b"[" * 100_000 + b'\n\xff\x00\n{"batch": {}, "event": "begun"}\n3\n'
    )
    (folder / "manifest.json").write_bytes(b"\xff not JSON")
    run_into(path, study, 1, unwatched)
    assert batch.read_bytes()[:4] == whole[:4]
    assert verified(batch)
    assert json.loads((folder / "manifest.json").read_text())["files"][0]["executed"] == 1
    assert [p.name for p in folder.glob("*.set-aside")] == [f"{batch.name}.set-aside"]
    assert not (tmp_path / "sprung").exists()


# where results go -----------------------------------------------------------------------------------------------------------


def test_results_take_the_place_of_a_link_and_leave_where_it_led(tmp_path):
    study, path = (
        make_study({"time": {"dt": "0.01 s", "duration": "0.1 s"}, "mesh": {"order": 1, "corner_levels": 0}}),
        tmp_path / "x.nc",
    )
    other = Path(tmp_path / "other.txt")
    other.write_text("mine")
    path.symlink_to(other)
    run_into(path, study, 1, unwatched)
    assert not path.is_symlink()
    assert other.read_text() == "mine"
