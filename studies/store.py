"""The batches of a study on disk: a file each, named by what decides its content, with a journal and a manifest beside them."""

import json
import time
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from hashlib import sha256
from itertools import chain, count
from pathlib import Path
from typing import IO, Any, Literal, Self
from zipfile import ZIP_STORED, ZipFile

import numpy as np
from filelock import FileLock, Timeout

from engine import Spec, Status

from .files import clear_parts, whole
from .messages import StudyError
from .plan import Batch, Study
from .provenance import machine

AFTER_THE_FIRST = 2
"""Of a file that is set aside for the second time and later, the number behind its name."""


class Names:
    """Names of the batch files of a study, by their content."""

    def __init__(self, study: Study) -> None:
        self._study = study
        self._records = {
            name: sha256(repr(motion.dt).encode() + motion.acceleration.tobytes()).digest()
            for name, motion in study.motions.items()
        }
        self._cases: dict[int, bytes] = {}

    def of(self, batch: Batch) -> str:
        """Digest of the batch's cases, their records, how some follow from others, and of what computes them."""
        digest = sha256(machine().encode())
        for case in batch.all_cases:
            digest.update(self._case(case))
        scaling = self._study.scaling
        following = [
            (batch.cases.index(int(scaling.solved_as[case])), float(scaling.scaled_by[case])) for case in batch.followers
        ]
        digest.update(f"{len(batch.cases)} {following!r}".encode())
        return digest.hexdigest()[:32]

    def _case(self, case: int) -> bytes:
        if case not in self._cases:
            spec = self._study.cases[case]
            self._cases[case] = sha256(spec.model_dump_json().encode() + self._records_of(spec)).digest()
        return self._cases[case]

    def _records_of(self, spec: Spec) -> bytes:
        return b"".join(self._records.get(name, b"") for name in (spec.motion.record, spec.motion.vertical_record))


# one file -------------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Header:
    """What a batch file says of itself: its name, how each case ended and why, and shape (of a case) and dtype of every array.

    Where `shapes` is empty nothing was computed.
    """

    name: str
    status: list[int]
    reason: list[str]
    shapes: dict[str, tuple[list[int], str]]


def write_batch(path: Path, status: Sequence[int], reason: Sequence[str], cases: Mapping, model: Mapping) -> None:
    """Write arrays of a batch's cases, case first (`time` excepted), and those of its model; OSError where that fails."""
    shapes = {name: (list(a.shape if name == "time" else a.shape[1:]), a.dtype.str) for name, a in cases.items()}
    shapes |= {name: (list(array.shape), array.dtype.str) for name, array in model.items()}
    header = {"name": path.stem, "status": [int(s) for s in status], "reason": [str(r) for r in reason], "shapes": shapes}
    with whole(path) as part, part.open("wb") as file:
        np.savez(file, allow_pickle=False, header=np.frombuffer(json.dumps(header).encode(), np.uint8), **cases, **model)


class Arrays:
    """The arrays of a batch file: by name, each read when it is asked for. ValueError where one is not what the header says."""

    def __init__(self, packed: ZipFile) -> None:
        for entry in packed.infolist():
            if entry.compress_type != ZIP_STORED:
                raise ValueError(f"{entry.filename} is packed")
        self._zip = packed
        with packed.open("header.npy") as raw:
            self.header = Header(**json.loads(np.lib.format.read_array(raw, allow_pickle=False).tobytes()))
        status, reason = self.header.status, self.header.reason
        ended = all(type(s) is int and s in list(Status) for s in status) and all(type(r) is str for r in reason)
        if not ended or len(status) != len(reason):
            raise ValueError("does not say how its cases ended")

    def __getitem__(self, name: str) -> np.ndarray:
        with self._zip.open(f"{name}.npy") as raw:
            shape, order, kind = self._described(name, raw)
            return np.frombuffer(bytearray(raw.read()), kind).reshape(shape, order=order)

    def _described(self, name: str, raw: IO[bytes]) -> tuple[tuple[int, ...], Literal["C", "F"], np.dtype]:
        """Shape, order and dtype of an array: those that its header says, and not of objects; `raw` is at the values then."""
        shape, dtype = self.header.shapes[name]
        np.lib.format.read_magic(raw)
        found, columns_first, kind = np.lib.format.read_array_header_1_0(raw)
        if found not in (tuple(shape), (len(self.header.status), *shape)) or kind.str != dtype or kind.hasobject:
            raise ValueError(f"{name} is not of the shape and kind that its header says")
        return found, "F" if columns_first else "C", kind

    @property
    def are_whole(self) -> bool:
        """Whether all are there and their checksums hold."""
        for name in self.header.shapes:
            with self._zip.open(f"{name}.npy") as raw:
                self._described(name, raw)
        return self._zip.testzip() is None


@contextmanager
def opened(path: Path) -> Iterator[Arrays]:
    """The arrays of a batch file; OSError where it is damaged, also where that comes out as an array is read."""
    try:
        with ZipFile(path) as packed:
            yield Arrays(packed)
    except OSError:
        raise
    except Exception as error:  # zipfile, zlib, json and numpy pass on whatever they met
        raise OSError(None, f"{path.name} is damaged ({error})", str(path)) from None


def verified(path: Path) -> bool:
    """Whether this is a whole batch file of that name, its checksums included."""
    try:
        with opened(path) as arrays:
            return arrays.header.name == path.stem and arrays.are_whole
    except OSError:
        return False


# all of a study ---------------------------------------------------------------------------------------------------------------


class Store:
    """The folder of a study's batch files."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.journal = folder / "journal.jsonl"
        self._executed: Counter[str] = Counter()

    @classmethod
    def beside(cls, results: Path) -> Self:
        """That of a results file: x.batches beside x.nc."""
        return cls(results.with_name(f"{results.name.removesuffix('.nc')}.batches"))

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Held while a run is at it; the operating system lets go when the process ends, however it ends.

        StudyError where another one holds it; OSError where the folder cannot be written to.
        """
        place = self.folder / "lock"
        lock = FileLock(place)
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            lock.acquire(timeout=0)
        except Timeout:
            raise StudyError(
                [f"{self.folder}: another run is writing here; let it end, or name another file with --out"]
            ) from None
        except OSError as error:
            raise OSError(error.errno, error.strerror, str(place)) from None
        try:
            clear_parts(self.folder)
            self._read_journal()
            yield
        finally:
            clear_parts(self.folder)
            lock.release()

    def path(self, name: str) -> Path:
        """The file of a batch."""
        return self.folder / f"{name}.npz"

    def names(self) -> set[str]:
        """Names of all batch files, whole or not."""
        return {path.stem for path in self.folder.glob("*.npz")}

    def holds(self, name: str) -> bool:
        """Whether the batch is there and whole; what is there and is not, is set aside."""
        path = self.path(name)
        if not path.exists():
            return False
        if verified(path):
            return True
        self._set_aside(path)
        return False

    def _set_aside(self, path: Path) -> None:
        places = (path.with_name(f"{path.name}.set-aside{n}") for n in chain([""], count(AFTER_THE_FIRST)))
        path.rename(next(place for place in places if not place.exists()))

    def keep_only(self, names: set[str]) -> None:
        """Remove all batch files but these."""
        for path in self.folder.glob("*.npz"):
            if path.stem not in names and path.is_file():
                path.unlink()

    def note(self, event: str, name: str, **facts: Any) -> None:
        """Add a line to the journal. A line that a full disk or a lost power has cut short spoils no other one."""
        line = json.dumps({"event": event, "batch": name, "at": time.strftime("%Y-%m-%dT%H:%M:%S%z")} | facts)
        with self.journal.open("ab") as file:
            file.write(f"{line}\n".encode() if self._ends_whole() else f"\n{line}\n".encode())
        self._executed[name] += event == "begun"

    def _ends_whole(self) -> bool:
        if not self.journal.exists() or not self.journal.stat().st_size:
            return True
        with self.journal.open("rb") as file:
            file.seek(-1, 2)
            return file.read(1) == b"\n"

    def _read_journal(self) -> None:
        """How often the computation of each batch was begun."""
        self._executed.clear()
        for line in self.journal.read_bytes().splitlines() if self.journal.exists() else ():
            with suppress(ValueError, KeyError, TypeError, RecursionError):
                entry = json.loads(line)
                self._executed[entry["batch"]] += entry["event"] == "begun"

    def write_manifest(self, study: Study, entries: Sequence["Entry"]) -> None:
        """Write manifest.json: a line a batch, which cases are where, how they ended, how often each batch was begun."""
        lines = ",\n".join(json.dumps(entry.in_words(self._executed[entry.name]), ensure_ascii=False) for entry in entries)
        head = json.dumps({"study": study.title, "cases": len(study.cases), "batches": len(entries)}, ensure_ascii=False)
        with whole(self.folder / "manifest.json") as part:
            part.write_text(f'{head[:-1]}, "files": [\n{lines}\n]}}\n', encoding="utf-8")


@dataclass(frozen=True)
class Entry:
    """A batch in the manifest: positions of its cases, and how they ended and why, where they have."""

    name: str
    cases: tuple[int, ...]
    status: tuple[int, ...] = ()
    reason: tuple[str, ...] = ()

    def in_words(self, executed: int) -> dict[str, Any]:
        """As the manifest says it, cases counted from 1."""
        ended = Counter(Status(status).name.lower() for status in self.status) or {"waiting": len(self.cases)}
        failed = {str(case + 1): reason for case, reason in zip(self.cases, self.reason, strict=False) if reason}
        found = {"file": f"{self.name}.npz", "cases": in_ranges(self.cases), "status": dict(ended), "executed": executed}
        return found | ({"failed": failed} if failed else {})


def in_ranges(cases: Sequence[int]) -> str:
    """Positions as numbers counted from 1: '1-16, 20'."""
    ordered = sorted(case + 1 for case in cases)
    starts = [i for i, case in enumerate(ordered) if i == 0 or case != ordered[i - 1] + 1]
    runs = [ordered[i:j] for i, j in zip(starts, [*starts[1:], len(ordered)], strict=True)]
    return ", ".join(str(run[0]) if len(run) == 1 else f"{run[0]}-{run[-1]}" for run in runs)
