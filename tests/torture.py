"""`make torture`: a run that is killed again and again and started again ends with the bits of one that was left in peace."""

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import xarray as xr

from tests.studies.conftest import SHORT

KILLS = 50
STUDY = 'title = "Tortured"\n' + SHORT.replace("0.4 s", "2 s")
SWEEP = '[sweep]\np0 = {{ from = 0, to = "4 MPa", num = 6 }}\ndamping_ratio = {{ from = 0.01, to = 0.05, num = {batches} }}\n'
MOMENTS = ("some time", "file", "part", "results")
"""When it is killed: after a random time, or as soon as a further batch, a part of one, or a part of the results is on disk."""

POLL = 0.001
"""[s] between two looks at the folder."""


@dataclass
class Tortured:
    """What was done to a run, and what came of it.

    killed : how often at which moments; rounds : how often it came to its end and began again from nothing
    begun, batches : how many batches were begun in the last round, and how many there are
    seen : of every batch file that was there after a kill, what the file system says of it
    """

    killed: Counter[str] = field(default_factory=Counter)
    rounds: int = 1
    begun: int = 0
    batches: int = 0
    seen: dict[Path, tuple[int, int]] = field(default_factory=dict)

    def look(self, folder: Path) -> None:
        """No file that was there may be another or gone."""
        for path, before in self.seen.items():
            assert _identity(path) == before, f"{path.name} was computed twice"
        self.seen |= {path: _identity(path) for path in folder.glob("*.npz")}


def _identity(path: Path) -> tuple[int, int]:
    found = path.stat()
    return found.st_ino, found.st_mtime_ns


def started(study: Path, results: Path, workers: int) -> subprocess.Popen:
    """The command line, in a process group of its own."""
    command = [sys.executable, "-m", "studies", "run", str(study), "--out", str(results), "--workers", str(workers)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True)


def ended(process: subprocess.Popen) -> str:
    """What a run said that must come to its end."""
    said, _ = process.communicate(timeout=300)
    assert process.returncode == 0, said
    return said


def torture(folder: Path, kills: int, batches: int, seed: int = 1, workers: int = 2) -> Tortured:
    """Kill a study of so many batches so often; assert that its results are those of a run in peace, no batch computed twice."""
    dice, found = random.Random(seed), Tortured(batches=batches)
    study = folder / "tortured.toml"
    study.write_text(STUDY + SWEEP.format(batches=batches))
    calm, results = folder / "calm.nc", folder / "tortured.nc"
    began = time.monotonic()
    ended(started(study, calm, workers))
    seconds = time.monotonic() - began
    while found.killed.total() < kills:
        moment = dice.choice(MOMENTS)
        process = started(study, results, workers)
        if not _reaches(moment, process, results, dice.uniform(0, seconds)):
            ended(process)
            assert_as_calm(results, calm, found)
            _from_nothing(results)
            found.seen.clear()
            found.rounds += 1
            continue
        _kill(process, everyone=dice.random() < 0.5)
        found.killed[moment] += 1
        found.look(results.with_suffix(".batches"))
    ended(started(study, results, workers))
    assert_as_calm(results, calm, found)
    return found


def _reaches(moment: str, process: subprocess.Popen, results: Path, seconds: float) -> bool:
    """Wait for a moment to kill a process; whether it comes before the process ends."""
    reached = _signs(moment, results, seconds)
    while process.poll() is None:
        if reached():
            return True
        time.sleep(POLL)
    return False


def _signs(moment: str, results: Path, seconds: float) -> Callable[[], bool]:
    """A question whose answer is true when the moment has come."""
    folder = results.with_suffix(".batches")
    if moment == "some time":
        end = time.monotonic() + seconds
        return lambda: time.monotonic() > end
    if moment == "file":
        n = len(list(folder.glob("*.npz")))
        return lambda: len(list(folder.glob("*.npz"))) > n
    pattern = "*.npz.*.part" if moment == "part" else f"{results.name}.*.part"
    place = folder if moment == "part" else results.parent
    before = set(place.glob(pattern))
    return lambda: bool(set(place.glob(pattern)) - before)


def _kill(process: subprocess.Popen, everyone: bool) -> None:
    """SIGKILL to the run alone, whose workers have to find out, or to all of its processes."""
    if everyone and os.name != "nt":
        os.killpg(process.pid, signal.SIGKILL)
    else:
        process.kill()
    process.communicate()


def _from_nothing(results: Path) -> None:
    folder = results.with_suffix(".batches")
    for path in [results, *folder.iterdir()]:
        path.unlink()


def assert_as_calm(results: Path, calm: Path, found: Tortured) -> None:
    """The variables bit for bit; no batch begun after it had ended; the manifest says how often each was begun."""
    with xr.open_dataset(results, engine="netcdf4") as tortured, xr.open_dataset(calm, engine="netcdf4") as ds:
        assert set(tortured.variables) == set(ds.variables)
        for name in ds.variables:
            assert tortured[name].dims == ds[name].dims
            np.testing.assert_array_equal(tortured[name].values, ds[name].values, err_msg=str(name))
    folder = results.with_suffix(".batches")
    found.look(folder)
    over, begun = set(), Counter[str]()
    for entry in journal(folder):
        assert entry["batch"] not in over, f"{entry['batch']} was computed twice"
        begun[entry["batch"]] += entry["event"] == "begun"
        if entry["event"] == "ended":
            over.add(entry["batch"])
    manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    assert {Path(entry["file"]).stem: entry["executed"] for entry in manifest["files"]} == dict(begun)
    assert len(begun) == found.batches
    found.begun = begun.total()


def journal(folder: Path) -> Iterator[dict[str, str]]:
    """The lines of a journal that are whole."""
    for line in (folder / "journal.jsonl").read_text().splitlines():
        try:
            yield json.loads(line)
        except ValueError:
            continue


def main(arguments: Sequence[str] | None = None) -> None:
    """Say what was done and that it did no harm."""
    parser = argparse.ArgumentParser(prog="python -m tests.torture", description=__doc__)
    parser.add_argument("--kills", type=int, default=KILLS)
    parser.add_argument("--batches", type=int, default=40)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args(arguments)
    began = time.monotonic()
    with TemporaryDirectory(prefix="torture-") as folder:
        found = torture(Path(folder), asked.kills, asked.batches, asked.seed)
    moments = ", ".join(f"{n} at: {moment}" for moment, n in found.killed.items())
    print(f"{found.killed.total()} kills ({moments}), {found.rounds} rounds to the end, {time.monotonic() - began:.0f} s")
    print(f"every round: the bits of the run in peace, no finished batch of {found.batches} computed twice")
    print(f"last round: {found.begun} batches begun for {found.batches} finished")


if __name__ == "__main__":
    main()
