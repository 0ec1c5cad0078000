"""The wheel, as `pip install .` builds it, carries all that a run needs and nothing else."""

import subprocess
import sys
from pathlib import Path, PurePosixPath
from zipfile import ZipFile

import pytest

ROOT = Path(__file__).parents[1]

KINDS = {".py", ".toml", ".AT2", ".md"}
"""Code, study files, records, and the note where the records come from."""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The wheel of this source tree, built by the build backend of pyproject.toml without a network."""
    folder = tmp_path_factory.mktemp("wheel")
    subprocess.run(
        [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", folder],
        cwd=ROOT,
        check=True,
        capture_output=True,
        timeout=60,
    )
    (built,) = folder.glob("coralquake-*-py3-none-any.whl")
    with ZipFile(built) as file:
        yield file


@pytest.fixture(scope="module")
def names(wheel):
    return {PurePosixPath(name) for name in wheel.namelist()}


@pytest.mark.parametrize("package", ["engine", "studies"])
def test_wheel_holds_every_file_of_the_packages(names, package):
    sources = {path.relative_to(ROOT) for path in (ROOT / package).rglob("*") if path.suffix in KINDS}
    assert {PurePosixPath(path.as_posix()) for path in sources} == {name for name in names if name.parts[0] == package}


@pytest.mark.parametrize("name", ["studies/p0.toml", "studies/motions/README.md", "studies/motions/ridgecrest-2019-clc-360.AT2"])
def test_wheel_holds_what_the_shipped_studies_read(wheel, name):
    assert wheel.read(name) == (ROOT / name).read_bytes()


def test_wheel_holds_no_other_folder(names):
    assert {name.parts[0].split("-")[0] for name in names} == {"engine", "studies", "coralquake"}


def test_wheel_makes_the_command(wheel, names):
    (entry_points,) = (name for name in names if name.name == "entry_points.txt")
    assert wheel.read(str(entry_points)).decode().split() == ["[console_scripts]", "coralquake", "=", "studies.__main__:main"]
