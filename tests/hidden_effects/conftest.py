"""The checks live beside the tests that share them: their assertions explain themselves too."""

import pytest

pytest.register_assert_rewrite("tests.hidden_effects.kit", "tests.hidden_effects.places")
