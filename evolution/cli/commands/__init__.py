"""The subcommands of `symbrion`, in the order of the pipeline."""

from evolution.cli.command import Command
from evolution.cli.commands.arena import Arena
from evolution.cli.commands.assets import Assets
from evolution.cli.commands.bench_suite import BenchSuite
from evolution.cli.commands.compare import Compare
from evolution.cli.commands.demo import Demo
from evolution.cli.commands.evolve import Evolve, Resume
from evolution.cli.commands.export import Export
from evolution.cli.commands.live import Live
from evolution.cli.commands.objects import Objects
from evolution.cli.commands.paper import Paper
from evolution.cli.commands.reconstruct import Reconstruct
from evolution.cli.commands.replay import Replay
from evolution.cli.commands.survey import Survey
from evolution.cli.commands.swarm import Swarm
from evolution.cli.commands.view import View

COMMANDS: dict[str, type[Command]] = {
    "survey": Survey,
    "reconstruct": Reconstruct,
    "arena": Arena,
    "objects": Objects,
    "view": View,
    "export": Export,
    "evolve": Evolve,
    "resume": Resume,
    "replay": Replay,
    "compare": Compare,
    "demo": Demo,
    "live": Live,
    "swarm": Swarm,
    "paper": Paper,
    "bench-suite": BenchSuite,
    "assets": Assets,
}

__all__ = ["COMMANDS", "Command"]
