"""What a user wrote is kept by name and version, restored as it was, or refused by name."""

import json

import fitnesses
import pytest

from evolution._src.errors import RunError
from evolution._src.references import Reference, check_signature, find_object, refer


def restore(reference: Reference) -> object:
    content = json.loads(json.dumps(reference.to_json()))
    return Reference.from_json(content, "scoring").restore("scoring", ["fitnesses"])


@pytest.mark.parametrize(
    "value",
    [fitnesses.minus_effort, fitnesses.progress_alone, fitnesses.Squared, fitnesses.Squared(factor=3.0)],
)
def test_functions_classes_and_instances_are_restored(value):
    assert restore(refer(value, "scoring")) == value


def test_a_version_is_the_own_one_or_a_digest_of_the_module():
    assert refer(fitnesses.minus_effort, "scoring").version == "1"
    assert len(refer(fitnesses.progress_alone, "scoring").version) == 16
    assert refer(Reference("a:b"), "scoring").version == ""


def make_closure():
    return lambda outcome, body: 0.0


@pytest.mark.parametrize(
    "value", [lambda outcome, body: 0.0, make_closure(), fitnesses.Remembering(1.0), object(), len]
)
def test_what_nothing_restores_is_refused(value):
    with pytest.raises(RunError, match=r"^scoring .*cannot be restored"):
        refer(value, "scoring")


def test_another_version_is_refused():
    reference = refer(fitnesses.minus_effort, "scoring")
    with pytest.raises(RunError, match=r"scoring fitnesses:minus_effort has changed: version '1', not '0'"):
        Reference(reference.name, "0").restore("scoring", ["fitnesses"])


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("fitnesses", "give 'module:name'"),
        ("absent_module:f", "cannot be imported"),
        ("fitnesses:absent", "no function or class"),
        ("os:system", "no function or class"),
        ("fitnesses:__doc__", "no function or class"),
    ],
)
def test_names_of_nothing_are_refused(name, message):
    with pytest.raises(RunError, match=message):
        find_object(name, "scoring")


@pytest.mark.parametrize(
    "content", [None, 7, {}, {"name": 7}, {"name": "a:b", "fields": 7}, {"name": "a:b", "x": 1}]
)
def test_damaged_references_are_refused(content):
    with pytest.raises(RunError, match="scoring"):
        Reference.from_json(content, "scoring")


def test_fields_of_a_function_are_refused():
    with pytest.raises(RunError, match="no dataclass"):
        Reference("fitnesses:minus_effort", "1", "{}").restore("scoring", ["fitnesses"])
    version = refer(fitnesses.Squared, "scoring").version
    with pytest.raises(RunError, match="recorded fields"):
        Reference("fitnesses:Squared", version, '{"factor": "big"}').restore("scoring", ["fitnesses"])


def test_signatures_are_checked():
    check_signature(fitnesses.minus_effort, "scoring", "outcome", "body")
    with pytest.raises(RunError, match=r"a function of \(outcome, body\) is needed"):
        check_signature(fitnesses.one_argument, "scoring", "outcome", "body")
