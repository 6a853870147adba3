"""The subcommands of `symbrion`, in the order of the pipeline."""

from evolution._src.cli.command import Command
from evolution._src.cli.commands.arena import Arena
from evolution._src.cli.commands.bench_suite import BenchSuite
from evolution._src.cli.commands.evolve import Evolve, Resume
from evolution._src.cli.commands.experiments import Demo, Paper, Swarm, Train
from evolution._src.cli.commands.reconstruct import Reconstruct
from evolution._src.cli.commands.replay import Replay
from evolution._src.cli.commands.survey import Survey
from evolution._src.cli.commands.view import Export, View

COMMANDS: dict[str, type[Command]] = {
    "survey": Survey,
    "reconstruct": Reconstruct,
    "arena": Arena,
    "view": View,
    "export": Export,
    "train": Train,
    "evolve": Evolve,
    "resume": Resume,
    "replay": Replay,
    "demo": Demo,
    "swarm": Swarm,
    "paper": Paper,
    "bench-suite": BenchSuite,
}
