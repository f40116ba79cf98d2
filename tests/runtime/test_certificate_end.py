"""A certificate that ends soon is told at the start of the process that shows it."""

from __future__ import annotations

import pytest

from schemas.deployment import RouterSection
from services.credentials.authority import Authority
from services.runtime.bus.connection import ends_soon


@pytest.mark.parametrize(("days", "said"), [(12, "ends in 12 days"), (0, "has expired"), (365, "")])
def test_a_certificate_that_ends_within_a_month_is_told_with_the_remedy(tmp_path, days, said):
    authority = Authority(tmp_path / "ca.pem", tmp_path / "ca.key")
    authority.sign_client("planner", tmp_path / "planner.pem", tmp_path / "planner.key", days=days)
    router = RouterSection(tls=True, certificate=str(tmp_path / "planner.pem"), key=str(tmp_path / "planner.key"))
    warning = ends_soon(router)
    assert bool(warning) == bool(said)
    assert said in warning
    assert not warning or "`gemelo deploy keys` renews it" in warning


def test_without_tls_nothing_ends():
    assert ends_soon(RouterSection()) == ""
