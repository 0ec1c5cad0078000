"""The Makefile finds a Python, says what to install where there is none, and works in a folder with a space in it."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

MAKE = shutil.which("make")
MAKEFILE = Path(__file__).parents[1] / "Makefile"

pytestmark = pytest.mark.skipif(MAKE is None or os.name == "nt", reason="wants make and a POSIX shell")

RECORDS_ITS_CALLS = 'echo "$@" >> calls; [ "$2" != venv ] || { mkdir -p "$3/bin" && cp "$0" "$3/bin/python"; }'


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A folder with a space in its name that holds the Makefile, what its targets need, and an empty folder for commands."""
    folder = tmp_path / "a checkout"
    (folder / "commands").mkdir(parents=True)
    shutil.copy(MAKEFILE, folder)
    for name in ("pyproject.toml", "pins.txt"):
        (folder / name).touch()
    return folder


def command(checkout: Path, name: str, script: str) -> None:
    path = checkout / "commands" / name
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(0o755)


def pretending(version: str, platform: str, machine: str) -> str:
    """A Python that runs code as if it were of another version and platform."""
    guise = f"import platform, sys; sys.version_info = ({version}, 0); sys.platform = '{platform}'"
    return f"""exec '{sys.executable}' -c "{guise}; platform.machine = lambda: '{machine}'; $2" """


def make(checkout: Path, *arguments: str, path: str = "") -> subprocess.CompletedProcess:
    """make, with no commands but those of the checkout and, where named, of `path`."""
    assert MAKE is not None
    places = os.pathsep.join([str(checkout / "commands"), *([path] if path else [])])
    return subprocess.run([MAKE, *arguments], cwd=checkout, env={"PATH": places}, capture_output=True, text=True, timeout=60)


def chosen(checkout: Path) -> str:
    """The Python that would make the environment."""
    (line,) = (line for line in make(checkout, "-n", ".venv/made").stdout.splitlines() if line.endswith("-m venv .venv"))
    return line.split(" -m ")[0]


def test_no_python_is_said_and_refused(checkout):
    done = make(checkout, "install")
    assert done.returncode == 2
    assert done.stdout.startswith("Python 3.11 to 3.14 (on Intel Macs to 3.13) was not found; install it")
    assert not (checkout / ".venv").exists()


@pytest.mark.parametrize(
    ("version", "platform", "machine", "fits"),
    [
        ("3, 10", "linux", "x86_64", False),
        ("3, 11", "linux", "x86_64", True),
        ("3, 14", "win32", "AMD64", True),
        ("3, 15", "linux", "x86_64", False),
        ("3, 14", "darwin", "arm64", True),
        ("3, 13", "darwin", "x86_64", True),
        ("3, 14", "darwin", "x86_64", False),
    ],
)
def test_versions_with_wheels_fit(checkout, version, platform, machine, fits):
    command(checkout, "python3", pretending(version, platform, machine))
    assert chosen(checkout) == ('"python3"' if fits else '""')


def test_newest_that_fits_is_taken(checkout):
    command(checkout, "python3.14", "exit 1")
    for name in ("python3", "python3.12", "python3.13"):
        command(checkout, name, "exit 0")
    assert chosen(checkout) == '"python3.13"'


def test_named_python_that_does_not_fit_is_refused(checkout):
    command(checkout, "old", pretending("3, 10", "linux", "x86_64"))
    done = make(checkout, "install", "PYTHON=old")
    assert (done.returncode, done.stdout) == (2, "old is not Python 3.11 to 3.14 (on Intel Macs to 3.13)\n")


def test_missing_venv_module_names_the_package(checkout):
    command(checkout, "python3", f"""case $2 in *ensurepip*) exit 1;; esac\nexec '{sys.executable}' "$@" """)
    done = make(checkout, "install")
    assert done.returncode == 2
    assert f"apt install python3.{sys.version_info[1]}-venv" in done.stdout


def test_install_with_spaces_in_every_path(checkout):
    command(checkout, "my python", RECORDS_ITS_CALLS)
    done = make(checkout, "install", f"PYTHON={checkout}/commands/my python", path=os.defpath)
    assert (done.returncode, done.stderr) == (0, "")
    calls = (checkout / "calls").read_text().splitlines()
    assert calls[-2] == "-m venv .venv"
    assert "install --quiet --only-binary :all: --constraint pins.txt --editable ." in calls[-1]
    assert make(checkout, "--question", "install", path=os.defpath).returncode == 1  # phony: its message is always due
    assert make(checkout, "--question", ".venv/installed", path=os.defpath).returncode == 0


@pytest.mark.parametrize("fails", [True, False])
def test_the_comparison_is_drawn_whether_opensees_can_be_installed_or_not(checkout, fails):
    refusal = 'case "$*" in *[[]peer]*) exit 1;; esac; ' if fails else ""
    command(checkout, "my python", refusal + RECORDS_ITS_CALLS)
    done = make(checkout, "versus", f"PYTHON={checkout}/commands/my python", path=os.defpath)
    assert (done.returncode, done.stderr) == (0, "")
    assert ("could not be installed" in done.stdout) == fails
    assert (checkout / ".venv" / "peer").exists() != fails  # tried again the next time
    assert (checkout / "calls").read_text().splitlines()[-1] == "-m benchmarks.versus"


@pytest.mark.parametrize(
    ("target", "module", "needs"),
    [("bench", "benchmarks", [".", ".[cluster]", ".[peer]"]), ("bench-large", "benchmarks.large", ["."])],
)
def test_benchmarks_install_what_they_measure(checkout, target, module, needs):
    command(checkout, "my python", RECORDS_ITS_CALLS)
    done = make(checkout, target, f"PYTHON={checkout}/commands/my python", path=os.defpath)
    assert (done.returncode, done.stderr) == (0, "")
    *installs, run = (checkout / "calls").read_text().splitlines()
    assert [line.rpartition("--editable ")[2] for line in installs[-len(needs) :]] == needs
    assert run == f"-m {module}"


def test_windows_has_its_own_folder_for_commands(checkout):
    assert ".venv/Scripts/python -m pip" in make(checkout, "-n", "install", "OS=Windows_NT").stdout
    assert ".venv/bin/python -m pip" in make(checkout, "-n", "install").stdout
