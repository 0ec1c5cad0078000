"""Where commands print, and how they refuse what is wrong."""

import typer
from rich.console import Console

from ..messages import StudyError, one_line
from ..plan import Study, load_study

DONE, SOME_FAILED, WRONG_INPUT, INTERRUPTED = 0, 1, 2, 130
"""Exit codes."""

out, err = Console(highlight=False), Console(stderr=True, highlight=False)


def say(line: str) -> None:
    """Print a line that the terminal wraps, not rich: a pager or grep takes it as it is; what steers a terminal is escaped."""
    out.print(one_line(line), markup=False, soft_wrap=True)


def refuse(lines: list[str]) -> typer.Exit:
    """Tell what is wrong; raise what this returns."""
    for line in lines:
        err.print(one_line(line), markup=False, soft_wrap=True)
    return typer.Exit(WRONG_INPUT)


def load_all(names: list[str]) -> list[Study]:
    """All studies, or the mistakes of all of them."""
    loaded, mistakes = [], []
    for name in names:
        try:
            loaded.append(load_study(name))
        except StudyError as error:
            mistakes += error.mistakes
    if mistakes:
        raise refuse(mistakes)
    return loaded
