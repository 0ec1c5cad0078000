"""Valid studies and records, mutated: each by a seed and a number alone. What load_study makes of them.

`python -m tests.fuzz.mutations --number N --seed S [--only K]` tries many; what it finds goes to results/fuzz.
"""

import argparse
import faulthandler
import os
import sys
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from typer.testing import CliRunner

from studies import StudyError, load_study
from studies.__main__ import app
from studies.plan import MOTIONS, shipped_studies
from tests.studies.malformed import KNET

Generator = np.random.Generator

STUDY = "m.toml"

MOST_SECONDS = 2.0
"""Of processor time, to refuse a file."""

MOST_MEMORY = 4 * 2**30
"""[bytes] of address space, in the command alone."""

LAID_OUT = """[box]
width = "5 m"
offset = "0.5 m"
nu = 0.2
[[layer]]
bottom = "6 m"
nu = 0.2
friction = 0.3
E = "1 GPa"
density = "2000 kg/m**3"
[[layer]]
bottom = "14 m"
nu = 0.25
friction = 0.4
Vs = "600 m/s"
density = "2 t/m**3"
[pressure]
p0 = "0.2 MPa"
[damping]
ratio = 0.05
frequencies = ["1 Hz", "8 Hz"]
[time]
dt = "0.01 s"
duration = "2 s"
[supports]
sides = "tied"
[output]
every = 2
[output.points]
X = ["1 m", "-1 m"]
[motion]
record = "a.AT2"
[sweep]
p0 = [0, "1 MPa", { from = "2 MPa", to = "4 MPa", num = 3, spacing = "log" }]
layer.1.friction = [0.1, 0.2]
"""

SETTINGS = {"a.AT2": "", "a.EW": "", "a.csv": 'record_unit = "cm/s**2"\n', "a.txt": 'record_unit = "Gal"\nrecord_dt = "0.01 s"\n'}

VALUES = [
    *r"""
0  1  -1  -0.0  3.5  true  false  nan  -inf  inf  1e400  1e-400  5e-324  1e308  0x10  1_000
1979-05-27  07:32:00  1979-05-27T07:32:00Z  []  {}  [1]  [[1]]  { a = 1 }  [{}]  'text'  ""  ''''''
"5 m"  "5 Pa"  "5 N/cm**2"  "5 g"  "-3 s"  "1e400 m"  "nan m"  "5 m m"  "5 m**9**9**9"  "((((5 m"  [1, 'a']
"\u202e\u0000\n\r\u001b[2J"  "\ud800"  "\U0010FFFF"  "🦀 Übung"  "{x}%s\\"  "[bold]x[/bold]"  "none"  "synthetic"  "ricker"
{ from = 0, to = '1 Pa', num = 1000000000000 }  { from = 1, to = 2, num = 2.5 }
"../../x"  "../../../../../../etc/passwd"  "/etc/passwd"  "/dev/zero"  "/dev/full"  "/dev/stdin"  "fifo"  "."  "~"
"file:///etc/passwd"  "http://a/b"  "C:\\x"  "a\nb"  "folder"  "m.toml"  "-"  "*"  "$(id)"  "|id"
""".strip()
    .replace("\n", "  ")
    .split("  "),
    "'''a\nb'''",
]
"""Of every type, of every size, and names of places that are no records."""

LARGE: tuple[Callable[[int], str], ...] = (
    lambda n: "1" * n,
    lambda n: f"0x{'f' * n}",
    lambda n: f'"{"x" * n}"',
    lambda n: f'"{"1" * n} m"',
    lambda n: "[" * n + "]" * n,
    lambda n: "{ a = " * n + "1" + " }" * n,
    lambda n: f"[{'1, ' * n}]",
    lambda n: f"[{'{}, ' * n}]",
    lambda n: f"{{ {'.'.join('a' * n)} = 1 }}",
    lambda n: f'"{chr(92)}u0041{"(" * n}"',
)

LONG = "1" * 5000
KEYS = ["a", "''", '"a.b"', r'"\n"', r'"\u001b[2J"', "layer.1.E", "layer.99.E", f"layer.{LONG}.E", "p0", "pressure", LONG]


@dataclass(frozen=True)
class Mutant:
    """Files by their names, the study among them, and what was done to them."""

    files: dict[str, bytes]
    deeds: tuple[str, ...]


def mutant(seed: int, number: int) -> Mutant:
    """Mutant `number` of a seed: a shipped study or one with everything, with one to three mutations of it or of its record."""
    rng = np.random.default_rng([seed, number])
    texts = [*(path.read_text() for path in shipped_studies().values()), *[LAID_OUT] * 6]
    name = str(rng.choice(list(SETTINGS)))
    text = texts[rng.integers(len(texts))].replace("motions/ridgecrest-2019-clc-360.AT2", name)
    text = text.replace("[motion]\n", f"[motion]\n{SETTINGS[name]}").replace('"a.AT2"', f'"{name}"')
    files, deeds = {STUDY: text.encode(), name: record(name)}, []
    for _ in range(rng.integers(1, 4)):
        file, ways = (name, WAYS[:N_OF_BYTES]) if rng.random() < 0.25 else (STUDY, WAYS)
        way = ways[rng.integers(len(ways))]
        files[file] = way(rng, files[file])
        deeds.append(f"{way.__name__.strip('_')} in {file}")
    return Mutant(files, tuple(deeds))


def record(name: str) -> bytes:
    """A valid record in the layout that its name stands for."""
    values = [50 * (-1) ** i for i in range(100)]
    if name == "a.AT2":
        return (MOTIONS / "ridgecrest-2019-clc-360.AT2").read_bytes()
    if name == "a.EW":
        return KNET.encode()
    if name == "a.csv":
        return ("t, a\n" + "".join(f"{0.01 * i:.2f},{value}\n" for i, value in enumerate(values))).encode()
    return "\n".join(map(str, values)).encode()


# of any file ----------------------------------------------------------------------------------------------------------------


def _cut_short(rng: Generator, raw: bytes) -> bytes:
    return raw[: rng.integers(len(raw) + 1)]


def _cut_out(rng: Generator, raw: bytes) -> bytes:
    start, end = sorted(rng.integers(len(raw) + 1, size=2))
    return raw[:start] + raw[end:]


def _bits_flipped(rng: Generator, raw: bytes) -> bytes:
    found = bytearray(raw)
    for place in rng.integers(len(raw), size=rng.integers(1, 9)) if raw else ():
        found[place] ^= 1 << rng.integers(8)
    return bytes(found)


def _binary_put_in(rng: Generator, raw: bytes) -> bytes:
    place = rng.integers(len(raw) + 1)
    return raw[:place] + rng.bytes(int(rng.choice([1, 4, 1000]))) + raw[place:]


def _encoded_otherwise(rng: Generator, raw: bytes) -> bytes:
    return raw.decode(errors="replace").encode(str(rng.choice(["utf-16", "utf-32", "utf-8-sig", "cp037"])), errors="replace")


def _lines_dropped_doubled_swapped(rng: Generator, raw: bytes) -> bytes:
    lines = raw.splitlines(keepends=True)
    for _ in range(rng.integers(1, 4) if lines else 0):
        i, j = rng.integers(len(lines), size=2)
        way = rng.integers(3)
        lines[i : i + 1] = [] if way == 0 else [lines[i]] * 2 if way == 1 else [lines[j]]
        if not lines:
            break
    return b"".join(lines)


def _some_of_it_many_times(rng: Generator, raw: bytes) -> bytes:
    lines = raw.splitlines(keepends=True) or [b"\n"]
    i = rng.integers(len(lines))
    piece = lines[i] if rng.random() < 0.5 else lines[i].rstrip()[-1:] or b" "
    return b"".join([*lines[:i], piece * int(10 ** rng.uniform(1, 6) / len(piece)), *lines[i:]])


def _number_changed(rng: Generator, raw: bytes) -> bytes:
    words = raw.split(b" ")
    i = rng.integers(len(words))
    choice = [
        b"",
        b"-",
        b"1e999",
        b"nan",
        b"-1",
        b"0",
        b"1e-320",
        b"999999999",
        b"1,5",
        b"\t",
        b"0x1",
        b"1" * 30000 + b"x",
        b"\xff",
    ]
    words[i] = choice[rng.integers(len(choice))]
    return b" ".join(words)


# of a study -----------------------------------------------------------------------------------------------------------------


def _settings(raw: bytes) -> tuple[list[str], list[int]]:
    """Lines of a study, and where among them a key is given a value."""
    lines = raw.decode(errors="replace").split("\n")
    return lines, [i for i, line in enumerate(lines) if "=" in line and not line.lstrip().startswith("#")]


def _with_setting(rng: Generator, raw: bytes, change: Callable[[str, str], str]) -> bytes:
    """The study with one `key = value` changed."""
    lines, places = _settings(raw)
    if places:
        i = places[rng.integers(len(places))]
        key, _, value = lines[i].partition("=")
        lines[i] = change(key.rstrip(), value.lstrip())
    return "\n".join(lines).encode(errors="replace")


def _value_of_another_kind(rng: Generator, raw: bytes) -> bytes:
    other = VALUES[rng.integers(len(VALUES))]
    return _with_setting(rng, raw, lambda key, value: f"{key} = {other}")


def _value_in_a_list_or_range(rng: Generator, raw: bytes) -> bytes:
    one, two = (VALUES[i] for i in rng.integers(len(VALUES), size=2))
    layout = (
        "[{}, {}]",
        "[{}, {}, {}]",
        "{{ from = {}, to = {}, num = 3 }}",
        "{{ from = {}, num = {} }}",
        "[{{ from = {}, to = {}, num = {} }}]",
    )
    written = layout[rng.integers(len(layout))].format(one, two, two)
    return _with_setting(rng, raw, lambda key, value: f"{key} = {written}")


def _large_value(rng: Generator, raw: bytes) -> bytes:
    written = LARGE[rng.integers(len(LARGE))](int(10 ** rng.uniform(1, 5)))
    return _with_setting(rng, raw, lambda key, value: f"{key} = {written}")


def _unit_of_another(rng: Generator, raw: bytes) -> bytes:
    lines, places = _settings(raw)
    values = [lines[i].partition("=")[2] for i in places] or ["1"]
    other = values[rng.integers(len(values))]
    return _with_setting(rng, raw, lambda key, value: f"{key} ={other}")


def _key_misspelt(rng: Generator, raw: bytes) -> bytes:
    def change(key: str, value: str) -> str:
        i = int(rng.integers(len(key) + 1))
        return f"{key[:i]}{rng.choice(['x', '.', '_', ' ', '-', ''])}{key[i + 1 :]} = {value}"

    return _with_setting(rng, raw, change)


def _key_of_another_kind(rng: Generator, raw: bytes) -> bytes:
    other = KEYS[rng.integers(len(KEYS))]
    return _with_setting(rng, raw, lambda key, value: f"{other} = {value}")


def _setting_put_in(rng: Generator, raw: bytes) -> bytes:
    key, value = KEYS[rng.integers(len(KEYS))], VALUES[rng.integers(len(VALUES))]
    return _with_setting(rng, raw, lambda k, v: f"{k} = {v}\n{key} = {value}")


def _table_of_another_kind(rng: Generator, raw: bytes) -> bytes:
    lines = raw.decode(errors="replace").split("\n")
    if heads := [i for i, line in enumerate(lines) if line.startswith("[")]:
        i = heads[rng.integers(len(heads))]
        name = lines[i].partition("#")[0].strip().strip("[]")
        ways = (
            f"[[{name}]]",
            f"[{name}.{name}]",
            f"[{name}]\n[{name}]",
            f"{name} = 3",
            f"{name} = []",
            f"[{name}",
            "[sweep]",
            f"[{'a.' * 30}a]",
        )
        lines[i] = ways[rng.integers(len(ways))]
    return "\n".join(lines).encode(errors="replace")


def _many_keys(rng: Generator, raw: bytes) -> bytes:
    n = int(10 ** rng.uniform(1, 4.5))
    line = str(rng.choice(["k{} = 1", "[t{}]", "[[layer]]", "layer.{}.E = ['1 Pa']", "output.points.p{} = 1"]))
    return raw + b"\n" + "\n".join(line.format(i) for i in range(n)).encode()


OF_BYTES = (
    _cut_short,
    _cut_out,
    _bits_flipped,
    _binary_put_in,
    _encoded_otherwise,
    _lines_dropped_doubled_swapped,
    _some_of_it_many_times,
    _number_changed,
)
OF_A_STUDY = (
    *(_value_of_another_kind, _value_in_a_list_or_range, _large_value, _unit_of_another, _key_misspelt, _key_of_another_kind),
    *(_setting_put_in, _table_of_another_kind, _many_keys, _value_of_another_kind, _value_in_a_list_or_range),
)
N_OF_BYTES = len(OF_BYTES)
WAYS = OF_BYTES + OF_A_STUDY


# what comes of it -----------------------------------------------------------------------------------------------------------


STUDY_IS_VALID, REFUSED = "a study", "refused"


def tried(found: Mutant, folder: Path) -> tuple[str, list[str]]:
    """What load_study and `coralquake run` make of a mutant in an empty folder, and what is wrong with that."""
    inner = folder / "a" / "b"  # so that ../../x lies in the folder too
    inner.mkdir(parents=True)
    (inner / "folder").mkdir()
    os.mkfifo(inner / "fifo")
    for name, raw in found.files.items():
        (inner / name).write_bytes(raw)
    before = _state(folder)
    start = time.process_time()
    try:
        load_study(inner / STUDY)
        return STUDY_IS_VALID, _changed(before, folder)
    except StudyError as error:
        mistakes, seconds = error.mistakes, time.process_time() - start
    except Exception as error:
        return REFUSED, [f"{type(error).__name__}: {error}"[:300]]
    return REFUSED, [*_wrong(mistakes, seconds), *_of_the_command(inner, mistakes), *_changed(before, folder)]


def _state(folder: Path) -> list[tuple[str, int, int]]:
    return sorted((str(path), path.lstat().st_size, path.lstat().st_mtime_ns) for path in folder.rglob("*"))


def _changed(before: list[tuple[str, int, int]], folder: Path) -> list[str]:
    return [] if _state(folder) == before else ["something was written"]


def _wrong(mistakes: list[str], seconds: float) -> list[str]:
    """What is wrong with the lines, or with the time they took."""
    told = [f"took {seconds:.1f} s of processor time"] if seconds > MOST_SECONDS else []
    if not mistakes:
        told.append("no mistake is told")
    for line in mistakes:
        if not line.startswith(f"{STUDY}: "):
            told.append(f"does not begin with the file: {line[:80]!r}")
        if not line.isprintable() or len(line) > 1000:
            told.append(f"is not a line: {len(line)} characters, {line[:80]!r}")
    return told


def _of_the_command(folder: Path, mistakes: list[str]) -> list[str]:
    outcome = CliRunner().invoke(app, ["run", str(folder / STUDY), "--out", str(folder / "out" / "x.nc")])
    if (outcome.exit_code, outcome.stdout) != (2, ""):
        return [f"ended with {outcome.exit_code}: {outcome.stdout[:80]!r} {outcome.exception!r}"]
    return [] if outcome.stderr.splitlines() == mistakes else [f"the command tells it otherwise: {outcome.stderr[:80]!r}"]


# the command ----------------------------------------------------------------------------------------------------------------


def main() -> int:
    """Try many mutants, and tell; exit code 1 where something is wrong with one."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz.mutations")
    parser.add_argument("--number", type=int, default=1000, help="mutants")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", type=int, help="this mutant alone")
    arguments = parser.parse_args()
    faulthandler.enable()
    _limit_memory()
    ended: Counter[str] = Counter()
    findings = 0
    for number in range(arguments.number) if arguments.only is None else [arguments.only]:
        faulthandler.dump_traceback_later(300, exit=True)
        found = mutant(arguments.seed, number)
        with TemporaryDirectory() as folder:
            end, lines = tried(found, Path(folder))
        ended[end] += 1
        for line in lines:
            print(f"mutant {number} ({', '.join(found.deeds)}): {line}; {_kept(found, arguments.seed, number)}", flush=True)
        findings += len(lines)
    faulthandler.cancel_dump_traceback_later()
    print(f"{ended.total():,} mutants: {', '.join(f'{n:,} {end}' for end, n in ended.items())}; {findings} findings")
    return int(findings > 0)


def _limit_memory() -> None:
    if sys.platform == "linux":
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MOST_MEMORY, MOST_MEMORY))


def _kept(found: Mutant, seed: int, number: int) -> Path:
    folder = Path("results/fuzz") / f"mutant-{seed}-{number}"
    folder.mkdir(parents=True, exist_ok=True)
    for name, raw in found.files.items():
        (folder / name).write_bytes(raw)
    return folder


if __name__ == "__main__":
    sys.exit(main())
