"""The folder into which a run on a stack of its own writes its results."""

from __future__ import annotations

import shutil
from pathlib import Path

from gemelo.schemas.reasons import because
from gemelo.tools.stack.stack import StackError

MARK = ".gemelo-results"  # in every such folder: what lies beside it may be removed by the next run


def new_results(folder: Path) -> Path:
    """The folder, made and empty: the results of an earlier run are removed, and nothing else ever is.

    Raises `StackError` where it holds anything that no run has left there, or is no folder.
    """
    try:
        if folder.exists() and any(folder.iterdir()):
            if not (folder / MARK).is_file():
                raise StackError(because("stack.results.others", folder=str(folder)))
            shutil.rmtree(folder)
        folder.mkdir(parents=True, exist_ok=True)
        (folder / MARK).write_text("the next run that writes here removes all that lies in this folder\n")
    except OSError as error:
        raise StackError(because("stack.results.unwritable", folder=str(folder), error=error.strerror or "")) from error
    return folder
