"""The command line as a user meets it: what it prints, where it writes, how it ends."""

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pandas as pd
import pytest
import xarray as xr
from typer.testing import CliRunner

from engine.spec import Layer, Spec
from studies import batch, load_study, run_study, runner, sentences, shipped_studies, table, write_dataset
from studies.__main__ import app
from studies.commands import running
from studies.show import TRACE_HEAD, show_lines
from studies.sizes import DomainSizes

from .conftest import FAILING, QUICK, SHORT, study_of

BAD = "[box]\nnu = 0.7\n[pressure]\np0 = 3\n"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty working folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def quick_toml(folder):
    path = folder / "quick.toml"
    path.write_text(QUICK)
    return path


@pytest.fixture
def results(folder, quick_ds):
    """The quick study's results in the working folder."""
    path = folder / "quick.nc"
    write_dataset(quick_ds, path)
    return path


def call(*arguments):
    """Run a command; an exception other than an exit is passed on."""
    outcome = CliRunner().invoke(app, [str(argument) for argument in arguments])
    if outcome.exception is not None and not isinstance(outcome.exception, SystemExit):
        raise outcome.exception
    return outcome


def flat(text):
    """Text without the line breaks that the width of the screen made."""
    return " ".join(text.split())


def files(folder):
    """All files but those of the batches."""
    found = (path.relative_to(folder) for path in folder.rglob("*") if path.is_file())
    return sorted(str(path) for path in found if path.parent.suffix != ".batches")


def refused(outcome, *lines):
    """Exit code 2, these lines on stderr, nothing else said."""
    assert outcome.exit_code == 2
    assert outcome.stdout == ""
    assert outcome.stderr.splitlines() == list(lines)


# run -----------------------------------------------------------------------------------------------------------------------


def test_run_writes_the_results_and_says_what_happened(quick_toml, folder, quick_ds):
    outcome = call("run", quick_toml, "--workers", 1)
    assert outcome.exit_code == 0
    assert files(folder) == ["quick.toml", "results/quick.nc"]
    said = flat(outcome.stdout)
    assert "Quick" in said
    for sentence in sentences(quick_ds):
        assert sentence in said
    assert re.search(r"quick │ +4 │ +0 │", outcome.stdout)
    xr.testing.assert_equal(xr.load_dataset("results/quick.nc", engine="netcdf4"), quick_ds)


def test_check_run_and_show_say_that_ratios_are_solved_once(folder):
    grid = 'p0 = ["1 MPa", "2 MPa"]\nscale = [1, 2]\n'
    (folder / "grid.toml").write_text(f'title = "Grid"\n{SHORT}[gravity]\nself_weight = false\n[sweep]\n{grid}')
    said = (
        "4 cases, 3 solved: each other one has the loads of one of these times a factor, and so its response times that factor."
    )
    assert said in call("check", "grid.toml").stdout.splitlines()
    assert said in flat(call("run", "grid.toml", "--workers", 1).stdout)
    assert "4: 4 done; 3 solved, " in call("show", "results/grid.nc").stdout


def test_nothing_is_said_where_all_cases_are_solved(quick_toml):
    assert "solved" not in call("check", quick_toml).stdout + call("run", quick_toml, "--workers", 1).stdout


def test_run_again_computes_nothing(quick_toml, folder, monkeypatch):
    call("run", quick_toml, "--workers", 1)
    before = (folder / "results/quick.nc").stat().st_mtime_ns
    monkeypatch.setattr(running, "run_into", lambda *a, **k: pytest.fail("it ran"))
    outcome = call("run", quick_toml)
    assert outcome.exit_code == 0
    assert "there already" in flat(outcome.stdout)
    assert "Before shaking" in outcome.stdout
    assert (folder / "results/quick.nc").stat().st_mtime_ns == before


def test_fresh_computes_anew(quick_toml, folder):
    call("run", quick_toml, "--workers", 1)
    before = (folder / "results/quick.nc").stat().st_mtime_ns
    outcome = call("run", quick_toml, "--fresh", "--workers", 1)
    assert outcome.exit_code == 0
    assert "there already" not in flat(outcome.stdout)
    assert (folder / "results/quick.nc").stat().st_mtime_ns > before


@pytest.mark.parametrize(
    "changed",
    [("num = 3", "num = 2"), ("0.4 s", "0.3 s"), ("clc-360", "clc-090"), ('title = "Quick"', 'title = "Other"')],
    ids=lambda pair: pair[1],
)
def test_a_changed_study_is_computed_anew(changed, quick_toml):
    call("run", quick_toml, "--workers", 1)
    quick_toml.write_text(QUICK.replace(*changed))
    assert "there already" not in flat(call("run", quick_toml, "--workers", 1).stdout)


def test_a_broken_file_of_before_is_computed_anew(quick_toml, folder):
    (folder / "results").mkdir()
    (folder / "results" / "quick.nc").write_bytes(b"half a file")
    assert call("run", quick_toml, "--workers", 1).exit_code == 0
    assert "status" in xr.load_dataset("results/quick.nc", engine="netcdf4")


def test_out_names_the_file(quick_toml, folder):
    assert call("run", quick_toml, "--out", "deep/mine.nc", "--workers", 1).exit_code == 0
    assert files(folder) == ["deep/mine.nc", "quick.toml"]


def test_plot_draws_beside_the_results(quick_toml, folder):
    """Those of a study that keeps one time: the others are those of test_plots."""
    quick_toml.write_text(QUICK.replace("[sweep]", "[output]\nevery = 1000\n[sweep]"))
    outcome = call("run", quick_toml, "--plot", "--workers", 1)
    assert outcome.exit_code == 0
    figures = [f"results/quick-{name}.png" for name in ("deformed", "interaction", "mesh", "peaks", "sections")]
    assert files(folder) == sorted(["quick.toml", "results/quick.nc", *figures])
    for figure in figures:
        assert f"figure {figure}" in flat(outcome.stdout)


def test_several_studies_at_once(folder):
    for name in ("a", "b"):
        (folder / f"{name}.toml").write_text(SHORT)
    outcome = call("run", "a.toml", "b.toml", "--workers", 1)
    assert outcome.exit_code == 0
    assert files(folder) == ["a.toml", "b.toml", "results/a.nc", "results/b.nc"]


def test_failed_cases_are_named_and_end_with_one(folder):
    (folder / "loose.toml").write_text(FAILING)
    outcome = call("run", "loose.toml", "--workers", 1)
    assert outcome.exit_code == 1
    assert "failed: p0 = 4 MPa: no static equilibrium" in flat(outcome.stdout)
    assert re.search(r"loose │ +2 │ +1 │", outcome.stdout)
    again = call("run", "loose.toml")
    assert again.exit_code == 1
    assert "failed: p0 = 4 MPa" in flat(again.stdout)
    assert "there already" in flat(again.stdout)


def test_many_failures_are_counted(folder):
    (folder / "loose.toml").write_text(FAILING.replace('p0 = [0, "4 MPa"]', 'p0 = { from = "4 MPa", to = "8 MPa", num = 25 }'))
    outcome = call("run", "loose.toml", "--workers", 1)
    assert outcome.exit_code == 1
    assert outcome.stdout.count("failed: ") == 20
    assert "and 5 more" in outcome.stdout
    assert "No case of this study has come to its end." in outcome.stdout


def test_a_study_of_which_nothing_can_be_built_is_told_in_one_line(quick_toml, folder, monkeypatch):
    def too_large(spec):
        raise MemoryError("no room for the mesh")

    monkeypatch.setattr(batch, "build_model", too_large)
    outcome = call("run", quick_toml, "--workers", 1)
    assert outcome.exit_code in (1, 2)
    assert "no room for the mesh" in flat(outcome.stdout + outcome.stderr)
    assert "Traceback" not in outcome.stderr


def interrupting(monkeypatch):
    """Interrupts the run in its first batch."""

    def interrupted(*arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr(runner, "carry_out", interrupted)


def test_an_interrupted_run_says_what_is_kept(quick_toml, folder, monkeypatch):
    interrupting(monkeypatch)
    outcome = call("run", quick_toml, "--out", "x.nc")
    assert outcome.exit_code == 130
    said = "Stopped; x.nc was not written. 0 of 1 batches are in x.batches; the same command goes on from there."
    assert said in outcome.stderr.splitlines()
    assert files(folder) == ["quick.toml"]


def test_an_interrupted_run_leaves_the_file_of_before(quick_toml, results, monkeypatch):
    before = results.read_bytes()
    interrupting(monkeypatch)
    assert call("run", quick_toml, "--out", results, "--fresh").exit_code == 130
    assert results.read_bytes() == before


# refusals ------------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("command", ["run", "check"])
def test_a_wrong_study_ends_with_two_and_one_line_a_mistake(command, folder):
    (folder / "bad.toml").write_text(BAD)
    refused(
        call(command, "bad.toml"),
        "bad.toml: box.nu = 0.7: must be less than 0.5",
        'bad.toml: pressure.p0 = 3: needs a unit, as in "3 Pa"',
    )
    assert files(folder) == ["bad.toml"]


def test_nothing_runs_where_one_of_several_studies_is_wrong(quick_toml, folder):
    (folder / "bad.toml").write_text(BAD)
    assert call("run", quick_toml, "bad.toml").exit_code == 2
    assert files(folder) == ["bad.toml", "quick.toml"]


def test_mistakes_of_several_studies_are_told_at_once(folder):
    (folder / "a.toml").write_text("[box]\nnu = 0.7\n")
    (folder / "b.toml").write_text("[box]\nnu = 0.8\n")
    refused(
        call("run", "a.toml", "b.toml"),
        "a.toml: box.nu = 0.7: must be less than 0.5",
        "b.toml: box.nu = 0.8: must be less than 0.5",
    )


def test_long_messages_are_not_broken(folder):
    (folder / "bad.toml").write_text('[motion]\nrecord = "nix.AT2"\n')
    outcome = call("check", "bad.toml")
    (line,) = outcome.stderr.splitlines()
    assert len(line) > 100


def test_a_missing_study_is_told_with_the_shipped_names(folder):
    refused(
        call("run", "nix"),
        '"nix": there is no such file, nor a shipped study of that name (damping, domain_size, grid, p0, paper, scale)',
    )


def test_a_study_must_be_named(folder):
    refused(call("run"), "run: name a study, or say --all (coralquake list shows what is shipped)")


def test_out_is_for_one_study(quick_toml, folder):
    refused(call("run", quick_toml, "p0", "--out", "x.nc"), "--out x.nc: is for one study, 2 are named")


def test_out_must_not_be_a_folder(quick_toml, folder):
    (folder / "deep").mkdir()
    refused(call("run", quick_toml, "--out", "deep"), "deep: is a folder, must be a file")


def test_results_cannot_go_below_a_file(quick_toml, folder):
    (folder / "results").write_text("in the way")
    refused(call("run", quick_toml), "results: is a file, must be a folder for the results")


@pytest.mark.parametrize("absolute", [True, False])
def test_results_do_not_overwrite_the_study(absolute, quick_toml, folder):
    out = quick_toml if absolute else quick_toml.name
    outcome = call("run", "quick.toml", "--out", out, "--workers", 1)
    assert outcome.exit_code == 2
    assert str(out) in outcome.stderr
    assert quick_toml.read_text() == QUICK


def test_studies_of_one_name_do_not_overwrite_each_other(folder):
    for place in ("a", "b"):
        (folder / place).mkdir()
        (folder / place / "same.toml").write_text(SHORT)
    assert call("run", "a/same.toml", "b/same.toml", "--workers", 1).exit_code == 2
    assert files(folder) == ["a/same.toml", "b/same.toml"]


@pytest.mark.parametrize(
    "arguments",
    [
        ("run", "p0", "--workers", "0"),
        ("run", "p0", "--nix"),
        ("run", "p0", "--trace", "--case", "0"),
        ("nix",),
        ("check",),
        ("show",),
    ],
    ids=" ".join,
)
def test_wrong_options_end_with_two(arguments, folder):
    outcome = call(*arguments)
    assert outcome.exit_code == 2
    assert "Traceback" not in outcome.stderr
    assert files(folder) == []


@pytest.mark.parametrize("command", ["table", "plot", "show"])
@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (None, "there is no such results file"),
        (b"", "is not a netCDF file"),
        (b"text", "is not a netCDF file"),
        (bytes(range(256)) * 8, "is not a netCDF file"),
    ],
    ids=["missing", "empty", "text", "binary"],
)
def test_a_file_that_holds_no_results_is_told_in_one_line(command, content, reason, folder):
    if content is not None:
        (folder / "x.nc").write_bytes(content)
    outcome = call(command, "x.nc")
    assert outcome.exit_code == 2
    (line,) = outcome.stderr.splitlines()
    assert line.startswith("x.nc: ")
    assert reason in line


@pytest.mark.parametrize("command", ["table", "plot", "show"])
def test_a_netcdf_file_of_others_is_told_in_one_line(command, folder):
    xr.Dataset({"t2m": ("time", [1.0])}).to_netcdf("x.nc", engine="netcdf4")
    refused(call(command, "x.nc"), "x.nc: was not written by coralquake")


# check ---------------------------------------------------------------------------------------------------------------------


def test_check_says_what_would_run_and_runs_nothing(quick_toml, folder, monkeypatch):
    monkeypatch.setattr(running, "run_into", lambda *a, **k: pytest.fail("it ran"))
    outcome = call("check", quick_toml)
    assert outcome.exit_code == 0
    assert files(folder) == ["quick.toml"]
    lines = outcome.stdout.splitlines()
    assert lines[0] == "Quick"
    assert any(line.startswith("cases ") and "4 in 1 batch" in line and "160 case-steps" in line for line in lines)
    assert any(line.startswith("mesh ") and "32 structure + 20 joint + 132 ground elements" in line for line in lines)
    warnings = [line.removeprefix("warning: ") for line in lines if line.startswith("warning: ")]
    assert any(
        line.startswith("bending ") and line.endswith("three-node triangles: walls at most 13.1 times too stiff")
        for line in lines
    )
    starts = ("time.dt = 0.01 s ", "the walls may be ", "the net uplift ", "pressure.p0 = 4 MPa bends ")
    assert len(warnings) == len(starts)
    assert all(warning.startswith(start) for warning, start in zip(warnings, starts, strict=True))


def test_check_of_the_default_mesh(folder):
    """Six-node triangles: right in bending, nothing to warn of."""
    (folder / "plain.toml").write_text('[pressure]\np0 = 0\n[time]\nduration = "1 s"\n')
    lines = call("check", "plain.toml").stdout.splitlines()
    assert any(line.startswith("bending ") and "six-node triangles: right where a wall bends" in line for line in lines)
    assert not [line for line in lines if line.startswith("warning: ")]


def test_check_takes_a_shipped_name(folder):
    assert call("check", "paper").stdout.splitlines()[0] == load_study("paper").title


# table ---------------------------------------------------------------------------------------------------------------------


def test_table_prints_one_row_a_case(results, quick_ds):
    """The swept field as the dataset has it, lengths in mm, stresses in MPa, three digits; sections by their names."""
    outcome = call("table", results)
    assert outcome.exit_code == 0
    lines = outcome.stdout.splitlines()
    head = flat(" ".join(lines[:-4]))
    assert (head.count("[mm]"), head.count("[MPa]"), head.count("[Pa]")) == (4, 1, 1)
    assert (head.count("[Nm/m]"), head.count("[N/m]")) == (1, 1)
    factors = [1, 1, 1, 1e3, 1e3, 1, 1e3, 1e3, 1, 1, 1e-6, 1]
    for line, (_, expected) in zip(lines[-4:], table(quick_ds).iterrows(), strict=True):
        section = expected.pop("section")
        assert line.count(f"  {section}  ") == 1
        shown = [float(word) for word in line.replace(section, "").split()]
        assert shown == pytest.approx([f * v for f, v in zip(factors, expected, strict=True)], rel=5e-3)  # three digits


def test_table_with_several_swept_fields_is_not_cut(folder):
    """Every number is whole, also where the table is wider than the screen."""
    sweep = '[sweep]\np0 = ["4 MPa"]\ndamping_ratio = [0.05]\nscale = [0.5]\ndomain_width = ["20 m"]\nlayer.3.friction = [0.41]\n'
    write_dataset(run_study(study_of(SHORT + sweep), workers=1), folder / "x.nc")
    outcome = call("table", "x.nc")
    assert "…" not in outcome.stdout
    assert len(re.split(r"\s{2,}", outcome.stdout.splitlines()[-1].strip())) == 17


def test_swept_lengths_are_shown_in_metres(folder):
    """A domain 20 m wide is not called one of 2e+04 mm."""
    write_dataset(run_study(study_of(SHORT + '[sweep]\ndomain_width = ["20 m"]\n'), workers=1), folder / "x.nc")
    outcome = call("table", "x.nc")
    assert outcome.stdout.splitlines()[-1].split()[0] == "20"
    assert "[m]" in outcome.stdout


def test_csv_holds_the_table_in_si(results, quick_ds, folder):
    assert call("table", results, "--csv", "x.csv").exit_code == 0
    pd.testing.assert_frame_equal(pd.read_csv("x.csv"), table(quick_ds), check_dtype=False, rtol=1e-15)


def test_csv_into_a_missing_folder_is_told(results):
    refused_line = call("table", results, "--csv", "nowhere/x.csv")
    assert refused_line.exit_code == 2
    (line,) = refused_line.stderr.splitlines()
    assert line.startswith("nowhere/x.csv: cannot be written: ")
    assert "None" not in line


# plot ----------------------------------------------------------------------------------------------------------------------


def test_plot_names_the_figures_it_draws(folder, failing_ds):
    write_dataset(failing_ds.isel(p0=[1]), folder / "lost.nc")
    outcome = call("plot", "lost.nc")
    assert outcome.exit_code == 0
    assert flat(outcome.stdout) == "figure lost-mesh.png"
    assert files(folder) == ["lost-mesh.png", "lost.nc"]


# show ----------------------------------------------------------------------------------------------------------------------


def test_show_says_what_a_file_is(results, reopened, folder):
    outcome = call("show", results)
    assert outcome.exit_code == 0
    assert outcome.stdout.splitlines() == list(show_lines(reopened))  # no line is broken or coloured
    assert files(folder) == ["quick.nc"]


# trace ---------------------------------------------------------------------------------------------------------------------


def test_trace_prints_a_case_step_by_step_and_writes_nothing(quick_toml, folder, quick_ds):
    """The third case, against the dataset: the joint points of each state at the steps that it keeps."""
    outcome = call("run", quick_toml, "--trace", "--case", 3)
    assert outcome.exit_code == 0
    assert outcome.stderr == ""
    assert files(folder) == ["quick.toml"]
    title, head, *steps, end = outcome.stdout.splitlines()
    assert title.startswith("case 3 of 4: p0 = ")
    assert head == TRACE_HEAD
    assert end == "done"
    numbers = [[float(word) for word in line.split()] for line in steps]
    assert [number[0] for number in numbers] == list(range(41))
    state = quick_ds["joint_state"].isel(p0=2)
    for kept, (_, time, *counts, _, _) in enumerate(numbers[::2]):
        here = state.isel(time=kept).values
        assert time == pytest.approx(float(quick_ds["time"][kept]), abs=1e-12)
        assert counts == [(here == 0).sum(), (here == 1).sum(), (here > 1).sum()]


def test_the_only_case_needs_no_number(folder):
    (folder / "one.toml").write_text(SHORT)
    for number in ((), ("--case", 1)):
        outcome = call("run", "one.toml", "--trace", *number)
        assert outcome.exit_code == 0
        assert outcome.stdout.splitlines()[0] == "case 1 of 1: the only case"
        assert len(outcome.stdout.splitlines()) == 3 + 41


def test_trace_of_a_failed_case_ends_with_its_reason(folder):
    (folder / "loose.toml").write_text(FAILING)
    outcome = call("run", "loose.toml", "--trace", "--case", 2)
    assert outcome.exit_code == 1
    reason = "no equilibrium: no static equilibrium: nothing holds the box under these loads"
    assert outcome.stdout.splitlines()[-1] == reason
    assert call("run", "loose.toml", "--trace", "--case", 1).exit_code == 0
    assert files(folder) == ["loose.toml"]


@pytest.mark.parametrize(
    ("options", "line"),
    [
        (("--trace",), "--case: must be a number from 1 to 4, the cases of quick"),
        (("--trace", "--case", 5), "--case 5: must be a number from 1 to 4, the cases of quick"),
        (("--case", 2), "--case 2: is for --trace"),
        (("other.toml", "--trace"), "--trace: is for one study, 2 are named"),
        (("other.toml", "--trace", "--case", 1), "--trace: is for one study, 2 are named"),
    ],
    ids=lambda value: " ".join(map(str, value)) if isinstance(value, tuple) else None,
)
def test_trace_wants_one_case_of_one_study(options, line, quick_toml, folder):
    refused(call("run", quick_toml, *options), line)
    assert files(folder) == ["quick.toml"]


def test_trace_of_a_wrong_study_tells_its_mistakes(folder):
    (folder / "bad.toml").write_text("[box]\nnu = 0.7\n")
    refused(call("run", "bad.toml", "--trace"), "bad.toml: box.nu = 0.7: must be less than 0.5")


# list and schema -----------------------------------------------------------------------------------------------------------


def test_these_studies_are_shipped():
    assert list(shipped_studies()) == ["damping", "domain_size", "grid", "p0", "paper", "scale"]
    assert (len(load_study("grid").cases), len(load_study("paper").cases)) == (320, 1)


def test_list_names_the_shipped_studies():
    outcome = call("list")
    assert outcome.exit_code == 0
    for name in shipped_studies():
        study = load_study(name)
        assert re.search(rf"^{name} +{len(study.cases)} cases? +{re.escape(study.title)}$", outcome.stdout, re.MULTILINE)


def fields_of_schema():
    """Lines of the schema by the dotted name of their field."""
    found, current = {}, ""
    for line in call("schema").stdout.splitlines():
        if match := re.match(r"\[\[?(\w+)\]\]?", line):
            current = match[1]
        elif match := re.match(r"(\w+) += (.+?) +# (.+)$", line):
            found[f"{current}.{match[1]}"] = (match[2], match[3])
    return found


def test_schema_lists_every_field_with_its_meaning():
    found = fields_of_schema()
    sections = {name: Layer if name == "layer" else type(info.default) for name, info in Spec.model_fields.items()}
    expected = {f"{table}.{field}" for table, section in sections.items() for field in section.model_fields}
    assert {name for name in found if not name.startswith(("sweep.", "domain_size."))} == expected
    assert {name for name in found if name.startswith("domain_size.")} == {f"domain_size.{n}" for n in DomainSizes.model_fields}
    assert all(len(meaning) > 3 for _, meaning in found.values())


def test_schema_shows_unit_default_and_rule():
    found = fields_of_schema()
    assert found["domain.width"][0] == '"20 m"'
    assert "> 0" in found["domain.width"][1]
    assert found["box.nu"] == ("0.3", "Poisson's ratio; ≥ 0, < 0.5")
    assert "tied | shear | roller | fixed" in found["supports.sides"][1]
    assert "Pa" in found["layer.E"][0]


def test_defaults_in_the_schema_can_be_copied_into_a_study():
    for name, (value, _) in fields_of_schema().items():
        if "–" not in value and "…" not in value and not name.startswith("sweep."):
            assert tomllib.loads(f"x = {value}"), name


def test_the_domain_sizes_of_the_schema_are_a_study():
    text = call("schema").stdout
    table = text[text.index("[domain_size]") :]
    (axis,) = study_of(SHORT + table).axes
    assert (axis.name, len(axis.values)) == ("domain", 6 + 2 * 5)


def test_help_names_the_commands():
    outcome = call("--help")
    assert outcome.exit_code == 0
    for command in ("run", "check", "plot", "show", "table", "list", "schema"):
        assert re.search(rf"\b{command}\b", outcome.stdout)


# other terminals -----------------------------------------------------------------------------------------------------------


def shell(folder, *arguments, **environment):
    """The installed program in a process of its own."""
    plain = {key: value for key, value in os.environ.items() if key not in ("COLUMNS", "NO_COLOR", "TERM", "FORCE_COLOR")}
    return subprocess.run(
        [sys.executable, "-m", "studies", *map(str, arguments)],
        cwd=folder,
        env=plain | environment,
        capture_output=True,
        timeout=120,
        check=False,
    )


@pytest.fixture(scope="module")
def narrow(tmp_path_factory, quick_ds):
    """Results on a narrow terminal without colour and with an encoding that lacks most letters."""
    folder = tmp_path_factory.mktemp("narrow")
    write_dataset(quick_ds, folder / "results" / "quick.nc")
    (folder / "quick.toml").write_text(QUICK)
    environment = {"COLUMNS": "40", "NO_COLOR": "1", "TERM": "dumb", "PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0"}
    return folder, environment


def test_run_on_a_narrow_terminal(narrow):
    folder, environment = narrow
    answer = shell(folder, "run", "quick.toml", **environment)
    assert (answer.returncode, answer.stderr) == (0, b"")
    said = answer.stdout.decode("ascii")
    assert "\x1b" not in said
    assert max(map(len, said.splitlines())) <= 40
    assert "the floor has lifted from p0 = 4 MPa on." in flat(said)


def test_table_on_a_narrow_terminal(narrow):
    folder, environment = narrow
    answer = shell(folder, "table", "results/quick.nc", **environment)
    assert (answer.returncode, answer.stderr) == (0, b"")
    row = re.split(r"\s{2,}", answer.stdout.decode("ascii").splitlines()[-1].strip())
    assert len(row) == 13
    assert [float(word) for word in row[:2]] == [4e6, 0.0]


def test_show_on_a_narrow_terminal(narrow):
    """Lines are not broken: a pager or grep takes them as they are; letters that the encoding lacks do not stop it."""
    folder, environment = narrow
    answer = shell(folder, "show", "results/quick.nc", **environment)
    assert (answer.returncode, answer.stderr) == (0, b"")
    lines = answer.stdout.decode("ascii").splitlines()
    assert lines[0] == "Quick"
    assert "\x1b" not in answer.stdout.decode("ascii")
    assert sum(line.startswith("base_acceleration ") for line in lines) == 1
    assert lines[-1].endswith('spacing = "log" }]')


def test_a_wrong_study_in_a_process_of_its_own(narrow):
    folder, environment = narrow
    (folder / "bad.toml").write_text(BAD)
    answer = shell(folder, "run", "bad.toml", **environment)
    assert answer.returncode == 2
    assert answer.stdout == b""
    assert answer.stderr.decode("ascii").splitlines() == [
        "bad.toml: box.nu = 0.7: must be less than 0.5",
        'bad.toml: pressure.p0 = 3: needs a unit, as in "3 Pa"',
    ]
    assert Path(folder / "results" / "bad.nc").exists() is False
