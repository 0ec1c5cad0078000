"""Where a dataset comes from: the study, the program and its versions, the records."""

import platform
import subprocess
from datetime import UTC, datetime
from functools import cache
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path

from llvmlite.binding import get_host_cpu_name

from engine import LANES

from .plan import Study

PACKAGES = ("numpy", "scipy", "numba", "llvmlite")
"""Those whose versions decide bits."""

MAKERS = ("arrays.py", "batch.py", "scaling.py", "schema.py", "uplift.py")
"""Sources here that decide the content of a batch file, beside the engine's."""

ATTRIBUTES = ("title", "study_name", "study", "study_hash", "records_sha256", "package_versions", "commit", "platform", "created")
"""Those of `provenance` that are read again."""


@cache
def computer() -> dict[str, str]:
    """What decides bits: digest of the engine's sources, versions of packages, lanes, processor."""
    here = Path(__file__).parent
    digest = sha256()
    for source in [*sorted((here.parent / "engine").rglob("*.py")), *(here / name for name in MAKERS)]:
        digest.update(source.name.encode() + b"\0" + source.read_bytes())
    return {
        "sources": digest.hexdigest()[:32],
        **{package: version(package) for package in PACKAGES},
        "lanes": str(LANES),
        "processor": f"{platform.system()} {platform.machine()} {get_host_cpu_name()}",
    }


@cache
def machine() -> str:
    """Digest of what computes. Equal ones give equal bits."""
    return sha256(repr(computer()).encode()).hexdigest()


def provenance(study: Study) -> dict[str, str]:
    packages = ("coralquake", "numpy", "numba", "scipy", "xarray", "netCDF4", "pandas")
    said = f"; {study.scaling.sentence}" if study.scaling.sentence else ""
    now = datetime.now(UTC).isoformat(timespec="seconds")
    return {
        "Conventions": "CF-1.11 UGRID-1.0",
        "title": study.title,
        "study_name": study.name,
        "study": study.text,
        "study_hash": study_hash(study),
        "records_sha256": records_sha256(study),
        "package_versions": ", ".join(f"{package} {version(package)}" for package in packages),
        "commit": _commit(),
        "platform": f"{platform.system()} {platform.machine()}, Python {platform.python_version()}",
        "processor": get_host_cpu_name(),
        "machine_hash": machine(),
        "created": now,
        "history": f"{now} computed by coralquake {version('coralquake')}{said}",
    }


def records_sha256(study: Study) -> str:
    """Names of the records with digests of their values."""
    return ", ".join(f"{name} {sha256(m.acceleration.tobytes()).hexdigest()}" for name, m in study.motions.items()) or "none"


def _commit() -> str:
    """Commit of the checkout that the program runs from, 'unknown' elsewhere."""
    folder = Path(__file__).parents[1]
    if not (folder / ".git").exists():  # an installed package may lie inside another project's checkout
        return "unknown"
    try:
        answer = subprocess.run(
            ["git", "-C", str(folder), "rev-parse", "HEAD"], capture_output=True, text=True, timeout=5, check=True
        )
    except (OSError, subprocess.SubprocessError):
        return "unknown"
    return answer.stdout.strip()


def study_hash(study: Study) -> str:
    """Digest of all that decides the result: cases, records, the engine's sources, versions of the numerical packages."""
    digest = sha256()
    for spec in study.cases:
        digest.update(spec.model_dump_json().encode())
    for name, motion in study.motions.items():
        digest.update(f"{name} {motion.dt!r}".encode() + motion.acceleration.tobytes())
    digest.update(repr([(axis.name, axis.values) for axis in study.axes]).encode() + study.title.encode())
    for folder in (Path(__file__).parent, Path(__file__).parent.parent / "engine"):
        for source in sorted(folder.rglob("*.py")):
            digest.update(source.read_bytes())
    digest.update(" ".join(version(package) for package in ("numpy", "scipy", "numba")).encode())
    return digest.hexdigest()
