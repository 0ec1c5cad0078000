"""A process of its own: clean settings, values as JSON, failures told, memory of its own."""

import os
import subprocess

import pytest

from benchmarks import process
from benchmarks.process import GIB, ONE_THREAD, apart, peak_gib, peak_of_children_gib


def settings(*names: str) -> dict[str, str | None]:
    """What a process finds in its environment."""
    return {name: os.environ.get(name) for name in names}


def refuses() -> None:
    raise ValueError("no")


def test_threads_are_one_and_foreign_kernels_are_not_asked_for(monkeypatch):
    monkeypatch.setenv("OPENBLAS_CORETYPE", "Haswell")
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "7")
    found = apart(settings, "OPENBLAS_CORETYPE", *ONE_THREAD)
    assert found == {"OPENBLAS_CORETYPE": None} | dict.fromkeys(ONE_THREAD, "1")
    assert os.environ["OPENBLAS_CORETYPE"] == "Haswell"


def test_a_process_that_fails_gives_nothing(capfd):
    with pytest.raises(subprocess.CalledProcessError):
        apart(refuses)
    assert "ValueError: no" in capfd.readouterr().err


def test_peak_is_read_in_kibibytes(monkeypatch, tmp_path):
    status = tmp_path / "status"
    status.write_text("VmPeak:\t 9999999 kB\nVmHWM:\t 2097152 kB\n")
    monkeypatch.setattr(process, "STATUS", status)
    assert peak_gib() == 2.0


def test_peak_of_a_process_is_its_own():
    """A child that imports next to nothing takes less than the block that its parent holds."""
    block = b"\1" * 2**28  # written, so that it is resident
    assert apart(peak_gib) < len(block) / GIB < peak_gib()


def test_without_that_file_the_system_is_asked(monkeypatch, tmp_path):
    monkeypatch.setattr(process, "STATUS", tmp_path / "absent")
    pytest.importorskip("resource")
    assert 0.01 < peak_gib() < 100  # an interpreter with numpy takes more than 10 MiB, no machine of ours has 100 GiB
    subprocess.run(["true"], check=True)
    assert 0 < peak_of_children_gib() < 100


def test_systems_without_usage_say_not_a_number(monkeypatch, tmp_path):
    monkeypatch.setattr(process, "STATUS", tmp_path / "absent")
    monkeypatch.setitem(__import__("sys").modules, "resource", None)
    assert peak_gib() != peak_gib()
