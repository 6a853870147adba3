"""The paper's experiments, repeated: one file each; results are saved in a folder as they are finished."""

from evolution._src.experiments.paper.config import QUICK, PaperConfig
from evolution._src.experiments.paper.experiments import run_experiments
from evolution._src.experiments.paper.folder import PaperFolder

__all__ = ["QUICK", "PaperConfig", "PaperFolder", "run_experiments"]
