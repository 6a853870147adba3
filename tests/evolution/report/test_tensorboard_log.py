"""The history goes to TensorBoard where it is installed; where not, the remedy is named."""

import importlib.util
import sys
from dataclasses import replace

import pytest
import toys

from evolution._src.cli.main import run as run_command
from evolution._src.errors import RunError
from evolution._src.report.tensorboard_log import FOLDER, SCALARS, TensorBoardLog
from evolution._src.search.config import EvolutionConfig
from evolution._src.search.loop import evolve, resume

TOY = EvolutionConfig(arena="truth", generations=2, stop_when_solved=False)
needs_tensorboard = pytest.mark.skipif(
    importlib.util.find_spec("tensorboard") is None,
    reason="TensorBoard is not installed: pip install 'symbrion-gym[tensorboard]'",
)


def test_without_tensorboard_the_remedy_is_named(monkeypatch, tmp_path, capsys):
    monkeypatch.setitem(sys.modules, "tensorboard.summary", None)
    with pytest.raises(RunError, match=r"symbrion-gym\[tensorboard\]"):
        TensorBoardLog()
    assert run_command(["evolve", "--folder", str(tmp_path / "run"), "--tensorboard", "--quiet"]) == 1
    assert "symbrion-gym[tensorboard]" in capsys.readouterr().err
    assert not (tmp_path / "run").exists()


@needs_tensorboard
def test_every_number_of_every_generation_is_there(tmp_path):
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    folder = tmp_path / "run"
    with TensorBoardLog() as callback:
        evolve(replace(TOY, folder=str(folder)), simulate=toys.bowl, on_generation=callback)
    with TensorBoardLog(first=2) as callback:
        run = resume(folder, generations=5, simulate=toys.bowl, on_generation=callback)
    events = EventAccumulator(str(folder / FOLDER))
    events.Reload()
    for name in SCALARS:
        events_of_name = events.Tensors(f"run/{name}")
        assert [event.step for event in events_of_name] == list(range(5))
        values = [event.tensor_proto.float_val[0] for event in events_of_name]
        assert values == pytest.approx(run.history[name].astype(float).tolist(), rel=1e-6)


@needs_tensorboard
def test_a_run_without_a_folder_has_no_place_for_it():
    with TensorBoardLog() as callback, pytest.raises(RunError, match="give it a folder"):
        evolve(TOY, simulate=toys.bowl, on_generation=callback)
