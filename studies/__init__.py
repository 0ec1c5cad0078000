"""Studies: from a file to a dataset, without the command line. `ds = run("p0")`, `table(ds)`, `sentences(ds)`."""

from .messages import StudyError
from .plan import Study, load_study, make_study, shipped_studies
from .run import run, run_study, write_dataset
from .table import sentences, table

__all__ = [
    "Study",
    "StudyError",
    "load_study",
    "make_study",
    "run",
    "run_study",
    "sentences",
    "shipped_studies",
    "table",
    "write_dataset",
]
