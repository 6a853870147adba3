"""The history of a run for TensorBoard: a copy for viewing, which is never read back."""

from pathlib import Path
from types import TracebackType
from typing import Any

from evolution._src.errors import RunError
from evolution._src.search.record import HISTORY
from evolution._src.search.run import Run

FOLDER = "tensorboard"
SCALARS = tuple(name for name in HISTORY.names or () if name != "generation")


class TensorBoardLog:
    """Writes the history row of each generation as scalars, into `tensorboard` in the run folder; an `OnGeneration`.

    Args:
        first: first generation that is written; earlier ones were written before.

    Raises:
        RunError: TensorBoard is not installed.
    """

    def __init__(self, first: int = 0) -> None:
        try:
            from tensorboard.summary import Writer
        except ImportError as error:
            raise RunError(
                "writing for TensorBoard needs it: pip install 'symbrion-gym[tensorboard]'; "
                "history.csv has the same numbers"
            ) from error
        self._make_writer = Writer
        self._writer: Any = None
        self._next = first

    def __call__(self, run: Run) -> None:
        """Write the new rows."""
        if run.folder is None:
            raise RunError("a run without a folder has no place for TensorBoard's files; give it a folder")
        try:
            self._write(run, run.folder / FOLDER)
        except OSError as error:
            raise RunError(f"{run.folder / FOLDER} cannot be written ({error})") from error
        self._next = len(run.history)

    def _write(self, run: Run, folder: Path) -> None:
        if self._writer is None:
            self._writer = self._make_writer(str(folder))
        for row in run.history[self._next :]:
            for name in SCALARS:
                self._writer.add_scalar(f"run/{name}", float(row[name]), int(row["generation"]))
        self._writer.flush()

    def __enter__(self) -> "TensorBoardLog":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._writer is not None:
            self._writer.close()
