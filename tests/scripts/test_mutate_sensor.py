"""The faults of `scripts/mutate_sensor.py` can still be put in, and tests notice some quick ones."""

from importlib import import_module
from typing import Any

import pytest
from mutate_sensor import REPOSITORY, failing, summary, unnoticed
from mutations.catalogue import MUTATIONS, REQUIRED, find_mutation
from mutations.fault import Mutation

REALISM = "tests/sim/sensor/test_sensor_realism.py"
COLOR = "tests/sim/sensor/test_color_path.py"
GUIDED = "tests/sim/sensor/guided"


def at(place: str) -> Any:
    module, _, path = place.partition(":")
    found = import_module(module)
    for name in path.split("."):
        found = getattr(found, name)
    return found


def test_every_fault_has_its_place_and_a_test_and_leaves_no_trace() -> None:
    files = REPOSITORY.glob("tests/sim/**/test_*.py")
    source = "".join(file.read_text(encoding="utf-8") for file in files)
    for mutation in MUTATIONS:
        assert f"def {mutation.meant}(" in source, mutation.name
        before = [at(place) for place in mutation.places]
        with pytest.MonkeyPatch.context() as patch:
            mutation.apply(patch)
            pairs = zip(mutation.places, before, strict=True)
            assert all(at(place) is not old for place, old in pairs), mutation.name
        assert [at(place) for place in mutation.places] == before, mutation.name


PLACE = "digs_warp.sim.sensor.error_attribution:"


def test_a_function_is_replaced_where_it_was_imported_and_a_place_that_is_gone_is_an_error() -> (
    None
):
    from digs_warp.sim.sensor.guided import tier

    with pytest.MonkeyPatch.context() as patch:
        Mutation("x", "", "", (PLACE + "attribute_errors",), lambda old: "new").apply(patch)
        assert tier.attribute_errors == "new"
        with pytest.raises(AttributeError, match="gone"):
            Mutation("x", "", "", (PLACE + "gone",), lambda old: old).apply(patch)
    with pytest.raises(ValueError, match=r"mutation 'nose': expected one of noise-1\.3"):
        find_mutation("nose")


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "test"),
    [
        ("noise-1.3", f"{COLOR}::test_both_noises_make_what_the_rig_states_at_middle_gray"),
        ("not-smooth", f"{GUIDED}/test_guided_search.py::test_disparity_and_costs_equal_the_twin_to_the_bit"),
        ("confidence-label", f"{REALISM}::test_confidence_is_no_label"),
    ],
)  # fmt: skip
def test_a_fault_is_noticed(name: str, test: str) -> None:
    case = {"not-smooth": "[5-1.0]", "confidence-label": "[built-in]"}.get(name, "")
    assert failing(name, [test + case]) == [test]


def test_without_a_fault_nothing_fails() -> None:
    assert failing("", [COLOR]) == []


def test_the_sum_tells_whether_the_test_for_a_fault_notices_it() -> None:
    noise, correlation = REQUIRED[:2]
    found = {noise.name: ["a.py::test_one", f"b.py::{noise.meant}"], correlation.name: []}
    assert unnoticed(found) == [correlation.name]
    assert summary(found).startswith("1 of 2 faults are noticed by the test that is there for")
