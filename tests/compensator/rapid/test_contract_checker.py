"""An independent grammar check of what is written: rapidchecker, run as a program of its own (AGPL: never imported)."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.compensator.rapid.small_programs import UNUSED, shift, target

CONFIGURATION = """indentation_check = false
require_uppercase_keywords = false
max_empty_lines = 99
require_new_line_eof = false
allow_trailing_space = true
"""
PROGRAM = f"""MODULE Checked
  CONST robtarget p10:={target(1, 2, 3)};
  PROC main()
    MoveJ p10, v100, z1, tool0;
    MoveL {target(4, 5, 6)}, v100, z1, tool0;
    MoveL p10, v100, z1, tool0;
    MoveL Offs(p10, 0, 0, 5), v100, fine, tool0;
  ENDPROC
ENDMODULE
"""


@pytest.fixture
def accepts(tmp_path):
    (tmp_path / "rapidchecker.toml").write_text(CONFIGURATION)

    def check(content: bytes) -> bool:
        file = tmp_path / "program.sys"
        file.write_bytes(content)
        run = subprocess.run([sys.executable, "-m", "rapidchecker", str(file)], cwd=tmp_path, capture_output=True, text=True)
        return run.returncode == 0

    return check


def test_a_corrected_program_is_accepted_as_the_posted_one_was(accepts):
    written = shift(PROGRAM, [0, 1, 2, 3], [[0.1, 0, 0], [0, 0.2, 0], [0, 0, 0.3], [0.1, 0, 0]])
    assert written.declarations == 2
    assert accepts(PROGRAM.encode())
    assert accepts(written.content)
    assert not accepts(written.content.replace(b"p10_c1, ", b"p10_c1 "))
    assert not accepts(written.content.replace(UNUSED.encode(), UNUSED[:-1].encode()))


@pytest.mark.parametrize("name", ["position_stream.mod"])
def test_the_modules_that_are_loaded_as_they_are_are_rapid(accepts, name):
    """Every instruction of the stream module is one that it needs, and all its moves stand still at their end."""
    text = (Path(__file__).parents[3] / "rapid_templates" / name).read_bytes()
    assert accepts(text)
    assert not accepts(text.replace(b"EGMReset streamId;", b"EGMReset streamId", 1))
    assert b"EGMRun" not in text.replace(b"nothing is guided", b"")
    assert text.isascii()
