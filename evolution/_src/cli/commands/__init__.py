"""The subcommands of `symbrion`, in the order of the pipeline."""

from evolution._src.cli.command import Command
from evolution._src.cli.commands.arena import Arena
from evolution._src.cli.commands.assets import Assets
from evolution._src.cli.commands.bench_suite import BenchSuite
from evolution._src.cli.commands.compare import Compare
from evolution._src.cli.commands.demo import Demo
from evolution._src.cli.commands.evolve import Evolve, Resume
from evolution._src.cli.commands.export import Export
from evolution._src.cli.commands.live import Live
from evolution._src.cli.commands.objects import Objects
from evolution._src.cli.commands.paper import Paper
from evolution._src.cli.commands.reconstruct import Reconstruct
from evolution._src.cli.commands.replay import Replay
from evolution._src.cli.commands.survey import Survey
from evolution._src.cli.commands.swarm import Swarm
from evolution._src.cli.commands.view import View

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
