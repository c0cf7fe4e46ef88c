"""The error tree on the wire."""

import pickle

import pytest

from thinknav_proto import (
    InvalidRequest,
    Overloaded,
    PlannerError,
    PlannerFailed,
    ProtocolMismatch,
    error_from_wire,
)

BRANCHES = PlannerError.__subclasses__()


@pytest.mark.parametrize("branch", BRANCHES)
def test_each_error_survives_the_wire_and_pickling(branch: type[PlannerError]) -> None:
    error = branch("the reason")
    for copy in (error_from_wire(error.to_wire()), pickle.loads(pickle.dumps(error))):
        assert type(copy) is branch
        assert copy.to_wire() == error.to_wire()
        assert str(copy) == "the reason"


def test_no_two_errors_share_a_code_or_a_status() -> None:
    assert len(BRANCHES) == 7
    assert len({branch.code for branch in BRANCHES}) == len(BRANCHES)
    assert len({branch.http_status for branch in BRANCHES}) == len(BRANCHES)


@pytest.mark.parametrize("branch", BRANCHES)
def test_the_docstring_draws_each_error(branch: type[PlannerError]) -> None:
    import thinknav_proto.errors

    assert f"── {branch.__name__} " in str(thinknav_proto.errors.__doc__)


@pytest.mark.parametrize("hint", [None, "soon", float("nan"), -1.0, float("inf")])
def test_a_senseless_retry_after_falls_back_to_the_default(hint: object) -> None:
    error = error_from_wire({"code": "overloaded", "message": "full", "retry_after": hint})
    assert isinstance(error, Overloaded)
    assert error.retry_after == 1.0


def test_retry_after_is_carried() -> None:
    error = error_from_wire(Overloaded("full", 2.5).to_wire())
    assert isinstance(error, Overloaded)
    assert error.retry_after == 2.5


def test_an_unknown_code_is_a_failure_that_names_it() -> None:
    error = error_from_wire({"code": "out_of_tea", "message": "no tea"})
    assert isinstance(error, PlannerFailed)
    assert error.message == "out_of_tea: no tea"


@pytest.mark.parametrize("wire", [None, [], {"code": "unavailable"}, {"code": 3, "message": "x"}])
def test_what_is_no_error_is_a_mismatch(wire: object) -> None:
    assert isinstance(error_from_wire(wire), ProtocolMismatch)


def test_the_root_catches_all() -> None:
    with pytest.raises(PlannerError, match="broken"):
        raise InvalidRequest("broken")
