"""Narrow terminals, terminals without colour, pipes and files: nothing is lost, no number is cut, no escape codes."""

import os
import re
import subprocess
import sys

import pytest
from rich.console import Console
from typer.testing import CliRunner

from studies import load_study, sentences, shipped_studies, table, write_dataset
from studies.__main__ import app
from studies.advice import advise
from studies.commands import console, running
from studies.show import show_lines

from .conftest import QUICK

WIDTHS = [40, 20, 200]


@pytest.fixture(scope="module")
def folder(tmp_path_factory, quick_ds):
    """A study and its results, in a folder with spaces and letters beyond ASCII."""
    folder = tmp_path_factory.mktemp("Prüfung mit Leerzeichen – Hầm")
    (folder / "kurz ü.toml").write_text(QUICK)
    write_dataset(quick_ds, folder / "results" / "kurz ü.nc")
    return folder


@pytest.fixture
def say(folder, monkeypatch):
    """What a command prints on stdout where the terminal is so wide."""

    def call(width, *arguments):
        monkeypatch.chdir(folder)
        for name, stderr in (("out", False), ("err", True)):
            monkeypatch.setattr(console, name, Console(width=width, stderr=stderr, highlight=False))
        outcome = CliRunner().invoke(app, [str(argument) for argument in arguments])
        assert outcome.exit_code == 0, outcome.output
        assert "\x1b" not in outcome.output  # a pipe, not a terminal
        return outcome.stdout

    return call


def words(text):
    return " ".join(text.split())


@pytest.mark.parametrize("width", WIDTHS)
def test_check_prints_every_fact_and_warning_in_a_line_of_its_own(say, width):
    advice = advise(load_study("p0"), 1)
    lines = say(width, "check", "p0", "--workers", 1).splitlines()
    expected = [words(f"{name} {value}") for name, value in advice.facts] + [f"warning: {line}" for line in advice.warnings]
    assert [words(line) for line in lines[-len(expected) :]] == expected
    assert words(" ".join(lines[: -len(expected)])) == "Water pressure on the box"


@pytest.mark.parametrize("width", WIDTHS)
def test_show_prints_every_line_whole(say, quick_ds, width):
    assert say(width, "show", "results/kurz ü.nc").splitlines() == list(show_lines(quick_ds))


@pytest.mark.parametrize("width", WIDTHS)
def test_table_prints_every_number_whole(say, quick_ds, width):
    """The same as on a wide terminal: a row a case, with all its numbers in a line."""
    printed = say(width, "table", "results/kurz ü.nc")
    assert printed == say(WIDTHS[-1], "table", "results/kurz ü.nc")
    rows = printed.splitlines()[-len(table(quick_ds)) :]
    for row, section in zip(rows, table(quick_ds)["section"], strict=True):
        cells = re.split(r"\s{2,}", row.strip())
        assert cells.pop(9) == section
        assert len([float(cell) for cell in cells]) == len(table(quick_ds).columns) - 1


@pytest.mark.parametrize("width", WIDTHS)
def test_list_names_every_study_with_its_title(say, width):
    said = words(say(width, "list"))
    for name in shipped_studies():
        study = load_study(name)
        assert f"{name} {len(study.cases)} case" in said
        assert study.title in said


@pytest.mark.parametrize("width", WIDTHS)
def test_schema_is_the_same_on_every_terminal(say, width):
    assert say(width, "schema") == say(WIDTHS[-1], "schema")


@pytest.mark.parametrize("width", [40, 200])
def test_run_says_its_sentences_and_its_summary(say, quick_ds, width):
    said = say(width, "run", "kurz ü.toml", "--workers", 1, "--out", f"w{width}.nc", "--fresh")
    assert max(map(len, said.splitlines())) <= max(width, 80)
    for sentence in sentences(quick_ds):
        assert sentence in words(said)
    assert f"w{width}.nc" in said
    assert re.search(r"kurz ü: 4 cases, 0 failures, \d+\.\d s" if width == 40 else r"│ kurz ü +│ +4 │ +0 │ +\d+\.\d s │", said)


@pytest.mark.parametrize("width", [40, 200])
def test_no_number_of_the_summary_is_cut(width, monkeypatch, capsys):
    monkeypatch.setattr(console, "out", Console(width=width, highlight=False))
    row = ("a-long-name-of-a-study", "100000", "100000", "12345.6 s", "/some/where/deep/below/results/a-long-name-of-a-study.nc")
    running._sum_up([row])
    said = capsys.readouterr().out
    for text in row[1:]:
        assert text in said


@pytest.mark.parametrize("name", ["T [/b] of [red]walls[mm]", "[/x]"])
def test_brackets_in_titles_and_names_are_text(name, folder, say):
    (folder / "t.toml").write_text(QUICK.replace("Quick", name))
    assert say(200, "check", "t.toml").splitlines()[0] == name
    (folder / "[b].toml").write_text(QUICK.replace("Quick", name))
    said = say(200, "run", "[b].toml", "--workers", 1)
    assert name in said
    assert "results/[b].nc" in said


@pytest.mark.parametrize(
    ("environment", "attributes"), [({"NO_COLOR": "1", "TERM": "xterm-256color"}, True), ({"TERM": "dumb"}, False)]
)
@pytest.mark.parametrize(
    "command", [("check", "p0"), ("run", "kurz ü.toml", "--out", "x.nc", "--fresh", "--workers", "1"), ("list",)]
)
def test_no_colour_on_a_terminal_that_wants_none(command, environment, attributes, folder, monkeypatch):
    """NO_COLOR leaves bold letters and the moving bar, a dumb terminal gets no code at all."""
    monkeypatch.chdir(folder)
    for name, stderr in (("out", False), ("err", True)):
        terminal = Console(force_terminal=True, stderr=stderr, highlight=False, width=40, _environ=environment)
        monkeypatch.setattr(console, name, terminal)
    outcome = CliRunner().invoke(app, command)
    assert outcome.exit_code == 0
    assert not re.search(r"\x1b\[[\d;]*\b(3|4|9|10)\d(;|m)", outcome.output)
    assert attributes or "\x1b" not in outcome.output


def test_a_reader_that_has_seen_enough_is_no_error(folder):
    """As `coralquake schema | head -1` is one: no traceback, whatever the exit code."""
    environment = {key: value for key, value in os.environ.items() if key not in ("NO_COLOR", "FORCE_COLOR")}
    process = subprocess.Popen(
        [sys.executable, "-m", "studies", "show", "results/kurz ü.nc"],
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    assert process.stdout is not None
    process.stdout.close()
    _, complaints = process.communicate(timeout=60)
    assert complaints == b""


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_results_do_not_replace_a_pipe_or_a_device(folder):
    os.mkfifo(folder / "pipe.nc")
    outcome = CliRunner().invoke(app, ["run", str(folder / "kurz ü.toml"), "--out", str(folder / "pipe.nc")])
    assert outcome.exit_code == 2
    assert outcome.stderr.endswith("pipe.nc: is a device or a pipe, results would replace it\n")


def test_a_full_disk_is_told_in_a_line(folder, monkeypatch, quick_ds):
    """netCDF4 raises RuntimeError where it has no room."""

    def full(*arguments, **settings):
        raise RuntimeError("NetCDF: HDF error")

    monkeypatch.setattr(type(quick_ds), "to_netcdf", full)
    outcome = CliRunner().invoke(app, ["run", str(folder / "kurz ü.toml"), "--out", str(folder / "f.nc"), "--workers", "1"])
    assert outcome.exit_code == 2
    assert "f.nc: cannot be written: NetCDF: HDF error; is the disk full? 1 of 1 batches are in " in outcome.stderr
