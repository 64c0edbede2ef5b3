"""The checks live beside the tests that share them: their assertions explain themselves too."""

import pytest

pytest.register_assert_rewrite("tests.runs.hidden_effects.hide_and_diagnose", "tests.runs.hidden_effects.places")
