"""Studies: from a file to a dataset, without the command line. `ds = run("p0")`, `table(ds)`, `sentences(ds)`."""

from importlib import import_module
from typing import Any

_HOMES = {
    "Study": "plan",
    "StudyError": "messages",
    "load_study": "plan",
    "make_study": "plan",
    "run": "runner",
    "run_study": "runner",
    "sentences": "tables",
    "shipped_studies": "plan",
    "table": "tables",
    "write_dataset": "runner",
}
"""Where each public name is defined."""

__all__ = sorted(_HOMES)


def __getattr__(name: str) -> Any:
    """A public name, its module imported when it is first asked for: `coralquake --help` passes through here too."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f".{_HOMES[name]}", __name__), name)
