"""The subcommands of `symbrion`, in the order of the road."""

from evolution.commands.arena import Arena
from evolution.commands.assets import Assets
from evolution.commands.command import Command
from evolution.commands.compare import Compare
from evolution.commands.demo import Demo
from evolution.commands.evolve import Evolve, Resume
from evolution.commands.paper import Paper
from evolution.commands.reconstruct import Reconstruct
from evolution.commands.replay import Replay
from evolution.commands.survey import Survey

COMMANDS: dict[str, type[Command]] = {
    "survey": Survey,
    "reconstruct": Reconstruct,
    "arena": Arena,
    "evolve": Evolve,
    "resume": Resume,
    "replay": Replay,
    "compare": Compare,
    "demo": Demo,
    "paper": Paper,
    "assets": Assets,
}

__all__ = ["COMMANDS", "Command"]
