"""The numba policy: where machine code is kept, what it depends on, and that the kernels are right without it."""

import ast
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numba
import numpy as np
import pytest

from engine.kernels import jit

compiled = pytest.mark.skipif(bool(numba.config.DISABLE_JIT), reason="needs compiled kernels")


@pytest.fixture
def copied_sources(tmp_path, monkeypatch):
    """The kernels' sources in a folder of their own, which `jit` takes for its own."""
    folder = tmp_path / "kernels"
    folder.mkdir()
    for source in Path(jit.__file__).parent.glob("*.py"):
        shutil.copy(source, folder)
    monkeypatch.setattr(jit, "__file__", str(folder / "jit.py"))
    return folder


@pytest.fixture
def a_file(tmp_path):
    """A file, in which nobody can make a folder."""
    path = tmp_path / "file"
    path.write_text("")
    return path


def test_key_changes_with_any_source(copied_sources):
    keys = {jit._key()}
    for source in sorted(copied_sources.glob("*.py")):
        source.write_text(source.read_text(encoding="utf-8") + "\n", encoding="utf-8")
        keys.add(jit._key())
    assert len(keys) == 1 + len(list(copied_sources.glob("*.py")))


def test_key_changes_with_a_new_source(copied_sources):
    before = jit._key()
    (copied_sources / "zzz.py").write_text("x = 1\n")
    assert jit._key() != before


def test_key_does_not_depend_on_the_time_of_a_file(copied_sources):
    before = jit._key()
    for source in copied_sources.glob("*.py"):
        os.utime(source, (0, 0))
    assert jit._key() == before


@pytest.mark.parametrize(
    ("name", "value"),
    [("FLAGS", {**jit.FLAGS, "nogil": False}), ("FLAGS", {**jit.FLAGS, "boundscheck": True}), ("LANES", 2 * jit.LANES)],
)
def test_key_changes_with_flags_and_lanes(monkeypatch, name, value):
    before = jit._key()
    monkeypatch.setattr(jit, name, value)
    assert jit._key() != before


def test_key_changes_with_the_version_of_numba(monkeypatch):
    before = jit._key()
    monkeypatch.setattr(numba, "__version__", "0.0.0")
    assert jit._key() != before


def test_named_folder_is_honoured(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "named"))
    folder = jit.cache_directory()
    assert folder == tmp_path / "named" / f"kernels-{jit._key()}"
    assert folder.is_dir()


@pytest.mark.parametrize(
    ("platform", "variable", "below"),
    [("linux", "XDG_CACHE_HOME", ""), ("darwin", "HOME", "Library/Caches"), ("win32", "LOCALAPPDATA", "")],
)
def test_users_folder_follows_the_platform(tmp_path, monkeypatch, platform, variable, below):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv(variable, str(tmp_path))
    monkeypatch.setattr(jit.sys, "platform", platform)
    assert jit.cache_directory() == tmp_path / below / "coralquake" / f"kernels-{jit._key()}"


def test_folder_that_cannot_be_made_falls_back_to_the_temporary_one(tmp_path, monkeypatch, a_file):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(a_file))
    monkeypatch.setattr(jit.tempfile, "gettempdir", lambda: str(tmp_path / "tmp"))
    assert jit.cache_directory() == tmp_path / "tmp" / "coralquake" / f"kernels-{jit._key()}"


def test_folder_that_cannot_be_written_falls_back_to_the_temporary_one(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "named"))
    monkeypatch.setattr(jit.tempfile, "gettempdir", lambda: str(tmp_path / "tmp"))
    monkeypatch.setattr(jit.os, "access", lambda folder, mode: "named" not in str(folder))
    assert jit.cache_directory().is_relative_to(tmp_path / "tmp")


def test_no_folder_at_all_is_said(monkeypatch, a_file):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(a_file))
    monkeypatch.setattr(jit.tempfile, "gettempdir", lambda: str(a_file))
    with pytest.raises(OSError, match="set NUMBA_CACHE_DIR"):
        jit.cache_directory()


def double(x):
    return 2.0 * x


@compiled
def test_kernel_is_kept_in_the_folder_and_other_packages_keep_theirs(tmp_path, monkeypatch):
    monkeypatch.setattr(numba.config, "CACHE_DIR", "theirs")
    monkeypatch.setattr(jit, "_DIRECTORY", str(tmp_path))
    kernel = jit.kernel(double)
    assert numba.config.CACHE_DIR == "theirs"
    assert kernel(2.0) == 4.0
    assert list(tmp_path.rglob("*double*.nbi"))


@compiled
@pytest.mark.parametrize("decorator", [jit.kernel, jit.summing_kernel])
def test_setting_is_restored_where_decorating_fails(monkeypatch, decorator):
    monkeypatch.setattr(numba.config, "CACHE_DIR", "theirs")
    with pytest.raises(TypeError):
        decorator("not a function")
    assert numba.config.CACHE_DIR == "theirs"


def test_flags_keep_nan_infinity_and_the_order_of_sums():
    assert jit.FLAGS["fastmath"] == {"contract"}
    assert jit.FLAGS["nogil"]
    assert "parallel" not in jit.FLAGS


def test_sums_of_summing_kernels_may_be_reordered_and_nothing_else():
    """NaN and infinity keep their meaning there too, and signed zeros and divisions theirs."""
    assert {"contract", "reassoc"} == jit.SUMMING
    assert jit.FLAGS["fastmath"] == {"contract"}  # those of plain kernels are not touched by them


def test_key_changes_with_what_summing_kernels_may_do(monkeypatch):
    before = jit._key()
    monkeypatch.setattr(jit, "SUMMING", {"contract"})
    assert jit._key() != before


MAKES = {"zeros", "empty", "ones", "full", "array", "copy", "concatenate", "arange", "zeros_like", "empty_like", "append"}


def test_only_allocating_kernels_make_arrays():
    """Others would never free them: numba compiles them all the same once an allocating one has made an array in that way."""
    found = []
    for source in Path(jit.__file__).parent.glob("*.py"):
        for function in ast.walk(ast.parse(source.read_text())):
            marks = {getattr(mark, "id", "") for mark in getattr(function, "decorator_list", ())}
            if marks & {"kernel", "summing_kernel", "inlined_kernel"}:
                calls = [node.func for node in ast.walk(function) if isinstance(node, ast.Call)]
                made = {call.attr for call in calls if isinstance(call, ast.Attribute)} & MAKES
                found += [f"{source.stem}.{function.name}: {name}" for name in made]
    assert found == []


def total(x):
    result = 0.0
    for i in range(x.shape[0]):
        result += x[i]
    return result


@compiled
def test_summing_kernel_sums_within_rounding_the_same_every_time(tmp_path, monkeypatch):
    monkeypatch.setattr(jit, "_DIRECTORY", str(tmp_path))
    summing = jit.summing_kernel(total)
    x = np.random.default_rng(1).normal(size=1001)
    # any order of n additions is off by n eps of the sum of magnitudes at most
    assert summing(x) == pytest.approx(total(x), abs=1001 * 2.2e-16 * abs(x).sum())
    assert len({summing(x) for _ in range(5)}) == 1
    assert np.isnan(summing(np.array([1.0, np.nan, 2.0])))
    assert summing(np.array([1.0, np.inf, 2.0])) == np.inf
    assert list(tmp_path.rglob("*total*.nbi"))


@compiled
def test_plain_kernel_sums_in_the_order_that_is_written(tmp_path, monkeypatch):
    monkeypatch.setattr(jit, "_DIRECTORY", str(tmp_path))
    x = np.random.default_rng(1).normal(size=1001)
    assert jit.kernel(total)(x) == total(x)


def divide(x, y):
    return x / y, np.isnan(x / y)


@compiled
def test_compiled_division_by_zero_is_infinity_or_nan():
    kernel = numba.njit(**jit.FLAGS)(divide)
    assert kernel(1.0, 0.0) == (np.inf, False)
    assert kernel(0.0, 0.0)[1]


@compiled
def test_sample_of_the_suite_passes_without_compilation():
    """The same tests on the same kernels as plain Python, where coverage sees them and indices are checked."""
    here = Path(__file__).parent
    sample = [
        str(here / f"test_{name}.py")
        for name in (
            *("blocks", "clock", "condense", "contact", "dense", "direct", "follow", "inverse", "joint"),
            *("loop", "march", "observe", "panels", "release", "sparse", "triangle", "vector"),
        )
    ]
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    command = [sys.executable, "-m", "pytest", "-x", "-p", "no:xdist", "-p", "no:cacheprovider", *sample]
    result = subprocess.run(command, env=environment, capture_output=True, text=True, cwd=here.parents[2], check=False)
    assert result.returncode == 0, result.stdout[-2000:]
    assert "passed" in result.stdout
