"""The paper's experiments, measured again: one file each, kept in a folder as they are done."""

from evolution.experiments.paper.config import QUICK, PaperConfig
from evolution.experiments.paper.experiments import run_experiments
from evolution.experiments.paper.folder import PaperFolder

__all__ = ["QUICK", "PaperConfig", "PaperFolder", "run_experiments"]
