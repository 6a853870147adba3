"""What a record says of its champions, without the search and without the controller that it is about."""

from collections.abc import Sequence

from evolution._src.backends.parts import BodyConfig
from evolution._src.search.config import EvolutionConfig
from evolution._src.search.record import VALIDATION, Record
from evolution._src.search.validation import Champion, select_champion


def find_champion(
    config: EvolutionConfig, record: Record, stage: int, names: Sequence[str]
) -> Champion | None:
    """Return the champion of a stage; None before its first generation."""
    is_in_stage = list(record.history["stage"] == stage)
    sufficient_rate = config.validation.success_threshold if config.body_lengths is not None else None
    entry = select_champion(record, is_in_stage, sufficient_rate)
    if entry is None:
        return None
    is_validated = entry.kind == VALIDATION
    return Champion(
        genotype=tuple(entry.genotype[: len(names)].tolist()),
        names=tuple(names),
        control=config.control,
        body=config.body if config.body_lengths is None else BodyConfig(entry.modules),
        episode=config.episode,
        arena=config.all_stages[stage].arena,
        generation=entry.generation,
        fitness=entry.fitness,
        successes=entry.outcome.successes if is_validated else 0,
        trials=entry.outcome.trials if is_validated else 0,
    )


def find_champions(
    config: EvolutionConfig, record: Record, num_stages: int, names: Sequence[str]
) -> tuple[Champion, ...]:
    """Return the champion of each stage that has one."""
    found = [find_champion(config, record, stage, names) for stage in range(num_stages)]
    return tuple(champion for champion in found if champion is not None)


def is_solved(config: EvolutionConfig, champion: Champion | None, stage: int) -> bool:
    """Return whether a champion solves a run: in its last stage, with the shortest body."""
    return (
        champion is not None
        and stage + 1 == len(config.all_stages)
        and config.validation.is_solved(champion.successes, champion.trials)
        and (config.body_lengths is None or champion.modules == config.body_lengths[0])
    )
