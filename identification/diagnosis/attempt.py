"""A candidate that is fitted; one whose fit does not converge is a candidate less, and no end of the diagnosis."""

from __future__ import annotations

from collections.abc import Sequence

from identification.common.findings import CompstiffError
from identification.fit.fitted_model import Term
from identification.fit.load_test import LoadTest
from identification.fit.posterior import Posterior, posterior

NOT_CONVERGED = "CS1011"


def attempt(data: LoadTest, terms: Sequence[Term], near: Posterior) -> Posterior | None:
    """The posterior with these terms, its search begun near another; None where it does not converge. Raises what else
    `posterior` raises."""
    try:
        return posterior(data, terms, near)
    except CompstiffError as stopped:
        if all(finding.code != NOT_CONVERGED for finding in stopped.findings):
            raise
        return None
