"""Controllers by what names them: a law of ours, an object, a class, a function, "module:name", or a record."""

import inspect
import sys
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import TYPE_CHECKING, Any

from evolution._src.controllers.controller import CONTROLLERS, OwnController, make_law
from evolution._src.controllers.protocol import CheckedController, Controller
from evolution._src.errors import RunError
from evolution._src.references import check_allowed, find_value, refuse
from reconstruction._src.base.range_checks import check_choice
from reconstruction._src.base.typed_json import JsonError, as_type
from symbrion_gym._src.tasks.storage import find_name

if TYPE_CHECKING:
    from symbrion_gym._src.robot.organism import Organism

_PLAIN = (bool, int, float, str, type(None))  # Types of arguments that a record can hold
_ADVICE = 'give a class or function of the organism that a module defines, or "module:name" of one'


@dataclass(frozen=True)
class ControllerSource:
    """A controller of a user, by reference. It can be hashed, compared, pickled and written as JSON."""

    name: str  # name of the controller
    version: str  # its version when the run began
    source: str  # "module:name" of a controller, or of a class or function of the organism that returns one
    # fields of a dataclass that `source` names; None for a class or function of the organism
    arguments: tuple[tuple[str, Any], ...] | None = None
    # whether its module may be imported; not where a file named it and nobody has allowed it since
    is_allowed: bool = field(default=True, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "arguments", freeze(self.arguments))

    def make(self, organism: "Organism", num_tracks: int) -> Any:
        """Return the controller for a body."""
        self.allow(())
        made = _make(find_of_module(self.source), organism, num_tracks, self.source, self.arguments)
        version = getattr(made, "version", None)
        if version != self.version:
            raise RunError(
                f"controller {self.source!r} is of version {version!r}, the record of {self.version!r}; "
                "restore that version of its module, or start a new run"
            )
        return made

    def allow(self, modules: Collection[str]) -> "ControllerSource":
        """Return the source that may be imported."""
        if not self.is_allowed:
            check_allowed(self.source, "controller", modules)
        return replace(self, is_allowed=True)


def find_of_module(source: str) -> Any:
    """Return what a file names as a controller: an object, or what the module itself defines, not what it imports."""
    found, module = find_value(source, "controller"), source.partition(":")[0]
    home = str(getattr(found, "__module__", None) or type(found).__module__)
    if not _is_controller(found) and home != module and not home.startswith(f"{module}."):
        raise RunError(f"controller {source} is of {home}, not of {module}: name it there")
    return found


def find_controller(spec: Any, organism: "Organism", num_tracks: int = 0) -> Controller:
    """Return the controller that something names, for a body.

    Args:
        spec: name of a law of ours, of `CONTROLLERS`; an object that follows `Controller`; a class or function of the
            organism that returns one (it also gets `num_tracks` if it has a parameter of that name); "module:name" of
            any of these; what `refer_to_controller` returned.
        organism: body that it moves.
        num_tracks: number of track speeds in an action: 0 with the option `track_control` "constant", 1 with "body",
            one per module with "modules", two with "skid".

    Raises:
        RunError: there is no such controller, it does not suit the body, or it is not of the version recorded.
    """
    if isinstance(spec, OwnController | CheckedController):
        return spec
    if isinstance(spec, ControllerSource):
        made = spec.make(organism, num_tracks)
    elif not isinstance(spec, str):
        what = getattr(spec, "__qualname__", type(spec).__qualname__)
        made = _make(spec, organism, num_tracks, what)
    elif ":" in spec:
        made = _make(find_value(spec, "controller"), organism, num_tracks, spec)
    else:
        return make_law(spec, organism, num_tracks)
    return CheckedController(made, len(organism.servos) + num_tracks, spec)


def refer_to_controller(
    spec: Any, organism: "Organism", num_tracks: int = 0, *, must_be_found: bool = False
) -> Any:
    """Return what stands for a controller in the configuration of a run and in jobs; of a record, import nothing."""
    if isinstance(spec, Mapping):
        try:
            return replace(as_type(dict(spec), ControllerSource, "controller"), is_allowed=False)
        except JsonError as error:
            raise RunError(str(error)) from error
    if isinstance(spec, ControllerSource):
        return spec
    if isinstance(spec, str) and ":" not in spec:
        check_choice("controller", spec, CONTROLLERS, RunError)
        return spec
    controller = find_controller(spec, organism, num_tracks)
    if isinstance(controller, OwnController):
        return controller.name
    try:
        return _find_source(controller, controller.name, controller.version)
    except RunError:
        if must_be_found:
            raise
    try:
        hash(spec)
    except TypeError as error:
        raise RunError(f"controller {spec!r} cannot be hashed; make its dataclass frozen") from error
    return spec


def check_genotype(name: str, genotype: Sequence[float], controller: Controller) -> None:
    """Refuse a genotype that is not one of a controller."""
    if len(genotype) != len(controller.parameters):
        raise RunError(
            f"{name} has {len(genotype)} genes; {controller.name} has {len(controller.parameters)} for this body: "
            f"{', '.join(controller.parameters)}"
        )
    genes = zip(controller.parameters, genotype, controller.lower, controller.upper, strict=True)
    for gene, value, low, high in genes:
        if not low <= value <= high:
            raise RunError(f"{name}: {gene} is {value:g}; {low:g} to {high:g} is needed")


def controller_to_json(controller: Any) -> str | dict[str, Any]:
    """Return what a record holds of a controller: its name, and of a user's its version and where it is found."""
    if isinstance(controller, str):
        return controller
    if isinstance(controller, OwnController):
        return controller.name
    name, version = (str(getattr(controller, key, "?")) for key in ("name", "version"))
    source = _find_source(controller, name, version)
    content: dict[str, Any] = {"name": source.name, "version": source.version, "source": source.source}
    return content if source.arguments is None else content | {"arguments": list(source.arguments)}


def _find_source(spec: Any, name: str, version: str) -> ControllerSource:
    """Return the reference to what a user gave as a controller."""
    spec = spec.spec if isinstance(spec, CheckedController) else spec
    if isinstance(spec, ControllerSource):
        return spec
    with refuse("controller"):
        if isinstance(spec, str):
            found = find_value(spec, "controller")
            is_defined = isinstance(found, type) or inspect.isroutine(found)
            return ControllerSource(name, version, find_name(found) if is_defined else spec)
        if isinstance(spec, type) or inspect.isroutine(spec):
            return ControllerSource(name, version, find_name(spec))
        for key, value in vars(sys.modules.get(type(spec).__module__, object)).items():
            if value is spec:
                return ControllerSource(name, version, find_name(spec, key))
        if is_dataclass(spec):
            given = [each.name for each in fields(spec) if each.init]
            arguments = tuple((each, freeze(getattr(spec, each))) for each in given)
            if _is_plain(arguments):
                return ControllerSource(name, version, find_name(type(spec)), arguments)
    raise RunError(
        f"controller {name!r} cannot be found again from a record or in a worker: it is an object that no module "
        f"names, and no dataclass of numbers and text; {_ADVICE}"
    )


def _make(found: Any, organism: "Organism", num_tracks: int, what: str, arguments: Any = None) -> Any:
    """Return a controller: what was found, or what it makes as a class or function of the organism."""
    if _is_controller(found):
        return found
    if not callable(found):
        raise RunError(f"controller {what!r} is {found!r}, which is no controller; {_ADVICE}")
    if arguments is not None and not (isinstance(found, type) and is_dataclass(found)):
        raise RunError(
            f"controller {what!r} has arguments and is no dataclass, which alone takes some from a record"
        )
    try:
        if arguments is not None:
            return found(**dict(arguments))
        parameters = inspect.signature(found).parameters
        options = {"num_tracks": num_tracks} if "num_tracks" in parameters else {}
        return found(*([organism] if parameters else []), **options)
    except RunError:
        raise
    except Exception as error:
        raise RunError(f"controller {what!r} cannot be made: {type(error).__name__}: {error}") from error


def _is_controller(found: Any) -> bool:
    return not isinstance(found, type) and hasattr(found, "act")


def freeze(value: Any) -> Any:
    """Return lists, at any depth, as tuples."""
    return tuple(map(freeze, value)) if isinstance(value, list | tuple) else value


def _is_plain(value: Any) -> bool:
    return all(map(_is_plain, value)) if isinstance(value, tuple) else isinstance(value, _PLAIN)
