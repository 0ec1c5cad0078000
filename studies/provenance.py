"""Where a dataset comes from: the study, the program and its versions, the records."""

import platform
import subprocess
from datetime import UTC, datetime
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path

from .plan import Study


def provenance(study: Study) -> dict[str, str]:
    packages = ("coralquake", "numpy", "numba", "scipy", "xarray", "netCDF4", "pandas")
    said = f"; {study.scaling.sentence}" if study.scaling.sentence else ""
    now = datetime.now(UTC).isoformat(timespec="seconds")
    records = ", ".join(f"{name} {sha256(m.acceleration.tobytes()).hexdigest()}" for name, m in study.motions.items())
    return {
        "Conventions": "CF-1.11 UGRID-1.0",
        "title": study.title,
        "study_name": study.name,
        "study": study.text,
        "study_hash": study_hash(study),
        "records_sha256": records or "none",
        "package_versions": ", ".join(f"{package} {version(package)}" for package in packages),
        "commit": _commit(),
        "platform": f"{platform.system()} {platform.machine()}, Python {platform.python_version()}",
        "created": now,
        "history": f"{now} computed by coralquake {version('coralquake')}{said}",
    }


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
