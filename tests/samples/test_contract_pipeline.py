"""samples/pipeline: the post processor, the script, the service and the container do what docs/pipeline.md says of them."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import numpy as np
import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name
from scipy.spatial.transform import Rotation

from tests.runs.command_line import user_files as kit
from tests.runs.command_line.workshop import TOOL, USER, workshop
from tests.support import started
from tests.test_documentation import environment

ROOT = Path(__file__).parents[2]
PIPELINE = ROOT / "samples/pipeline"
ROBOT = "irb6660-205-1.90"


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    """A cell folder as `init` and the chain leave it."""
    folder, job = tmp_path / "cell", workshop(ROBOT)
    (folder / "programs").mkdir(parents=True)
    (folder / "cell.yaml").write_text(job.files["cell.yaml"])
    (folder / "stiffness_extended.json").write_text(job.files["stiffness.json"])
    return folder


def intermediate(folder: Path) -> Path:
    """The file that RoboDK writes for a post: every instruction as a call, poses as x y z and three turns."""
    poses = kit.targets_of(workshop(ROBOT).files["part.mod"])
    first = np.radians([12.0, 18, 22, 25, 48, -30])

    def numbers(pose: kit.Frame) -> str:
        return ",".join(f"{value:.9f}" for value in [*(1e3 * pose.p), *pose.r.as_euler("ZYX", degrees=True)])

    def joints(pose: kit.Frame) -> str:
        angles = kit.solve(kit.IRB6660, USER @ pose @ TOOL.inv(), first)
        return ",".join(f"{value:.6f}" for value in np.degrees(angles))

    lines = ["import sys", f"sys.path[:0] = [{str(folder)!r}]", "from robodk.robomath import KUKA_2_Pose",
             "from compstiff_post import RobotPost",
             "def p(*xyzrpw): return KUKA_2_Pose(list(xyzrpw))",
             "r = RobotPost(r'compstiff_post', r'IRB 6660', 6)", "r.ProgStart(r'part')",
             f"r.setFrame(p({numbers(USER)}), -1, 'f')",
             f"r.setTool(p({numbers(TOOL)}), 1, 't')", "r.setSpeed(50)",
             *(f"r.MoveL(p({numbers(pose)}), [{joints(pose)}], [0,0,0])" for pose in poses),
             "r.ProgFinish(r'part')", f"r.ProgSave(r'{folder}', r'part', False, False)", "print('HANDED ON:', r.PROG_FILES)"]
    file = folder / "part_intermediate.py"
    file.write_text("\n".join(lines) + "\n")
    return file


def posted(cell: Path, tmp_path: Path) -> subprocess.CompletedProcess[str]:
    """RoboDK's part played: the intermediate file run, with the posts beside it."""
    folder = tmp_path / "posts"
    if not folder.exists():
        folder.mkdir()
        shutil.copy(PIPELINE / "compstiff_post.py", folder)
        shutil.copy(ROOT / "tests/samples/small_abb_post.py", folder)
        environment(tmp_path)
    variables = {"POST": "small_abb_post", "COMMAND": str(tmp_path / ".shims/compstiff"), "CELL": str(cell / "cell.yaml"),
                 "STIFFNESS": str(cell / "stiffness_extended.json"), "LOGS": str(cell / "programs"), "OPTIONS": "--tare 0:1"}
    return subprocess.run([sys.executable, intermediate(folder)], capture_output=True, text=True, timeout=120,
                          env=os.environ | {"PYTHONPATH": str(ROOT)} | {f"COMPSTIFF_{k}": v for k, v in variables.items()})


def test_the_post_hands_on_the_planned_program_then_the_corrected_one(cell: Path, tmp_path: Path) -> None:
    """First without a log, then with one, then generated again; the program is what `correct` itself makes of the planned."""
    pytest.importorskip("robodk", reason="the extra test brings it")
    first = posted(cell, tmp_path)
    assert first.returncode == 0, first.stderr
    assert re.search(r"HANDED ON: \['\S+part\.mod'\]", first.stdout), first.stdout
    planned = tmp_path / "posts/part.mod"
    for pose, meant in zip(kit.targets_of(planned.read_text()), kit.targets_of(workshop(ROBOT).files["part.mod"]), strict=True):
        assert np.linalg.norm(pose.p - meant.p) < 1e-8
        assert (pose.r * meant.r.inv()).magnitude() < 1e-7
    (cell / "programs/part.forces.csv").write_text(workshop(ROBOT).files["forces.csv"])
    for _ in range(2):
        second = posted(cell, tmp_path)
        assert second.returncode == 0, second.stderr
        assert re.search(r"HANDED ON: \['\S+part_corrected\.mod'\]", second.stdout), second.stdout
    by_hand = kit.run("correct", cell / "cell.yaml", planned, "--stiffness", cell / "stiffness_extended.json", "--forces",
                      cell / "programs/part.forces.csv", "--tare", "0:1", "-o", tmp_path / "by_hand.mod")
    assert by_hand.code == 0, by_hand
    assert (tmp_path / "posts/part_corrected.mod").read_bytes() == (tmp_path / "by_hand.mod").read_bytes()


def test_the_post_hands_nothing_on_where_the_correction_is_refused(cell: Path, tmp_path: Path) -> None:
    pytest.importorskip("robodk", reason="the extra test brings it")
    (cell / "programs/part.forces.csv").write_text(workshop(ROBOT).files["forces.csv"].replace("\n0,", "\n40,"))
    done = posted(cell, tmp_path)
    assert done.returncode == 0, done.stderr
    assert "HANDED ON: []" in done.stdout
    assert "POPUP: compstiff did not correct part.mod, and nothing is sent: " in done.stdout
    assert not (tmp_path / "posts/part_corrected.mod").exists()


def test_the_script_of_the_night(cell: Path, tmp_path: Path) -> None:
    where = environment(tmp_path)
    (cell / "programs/part.mod").write_text(workshop(ROBOT).files["part.mod"])
    (cell / "programs/part.forces.csv").write_text(workshop(ROBOT).files["forces.csv"])

    def night() -> subprocess.CompletedProcess[str]:
        return subprocess.run(["bash", PIPELINE / "correct_night.sh", cell, "--tare", "0:1"], env=where, capture_output=True,
                              text=True, timeout=300)

    for _ in range(2):
        done = night()
        assert done.returncode == 0, done.stderr
    lines = (cell / "corrected/night.jsonl").read_text().splitlines()
    assert [json.loads(line)["status"] for line in lines] == ["ok"]
    assert (cell / "corrected/part.mod").is_file()
    (cell / "stiffness_extended.json").write_text("{}")
    assert night().returncode == 1


def test_the_service_is_a_unit_and_its_call_is_one_of_ours(cell: Path, tmp_path: Path) -> None:
    unit = (PIPELINE / "compstiff-watch.service").read_text()
    call = re.search(r"^ExecStart=\S+/compstiff (.*)$", unit, re.M)
    assert call
    done = subprocess.run([sys.executable, "-m", "compstiff", *call[1].split(), "--once", "--settle", "0"], cwd=cell,
                          capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    if not shutil.which("systemd-analyze"):
        pytest.skip("systemd-analyze is not there: only the call was tried")
    # It looks for the program named, which is not installed where the tests run.
    program = tmp_path / "compstiff"
    program.write_text("#!/bin/sh\n")
    program.chmod(0o755)
    copy = tmp_path / "compstiff-watch.service"
    copy.write_text(unit.replace("/opt/compstiff/bin/compstiff", str(program)))
    verified = subprocess.run(["systemd-analyze", "verify", "--man=no", copy], capture_output=True, text=True, timeout=300)
    assert "compstiff-watch" not in verified.stderr, verified.stderr


def test_the_container_s_call_runs_without_root_and_its_health_is_the_lock(cell: Path, tmp_path: Path) -> None:
    """No container daemon is at hand: the file's words are looked at, its call and its health check run here."""
    text = re.sub(r"\\\n", " ", (PIPELINE / "Dockerfile").read_text())
    last = text.rpartition("\nFROM ")[2]
    assert re.search(r"^USER (?!root|0)\w+$", last, re.M)
    words = {key: json.loads(found) for key, found in re.findall(r"^(CMD|ENTRYPOINT) (\[.*\])$", last, re.M)}
    check = re.search(r"^HEALTHCHECK .*? CMD (\[.*\])$", last, re.M)
    assert check
    health = json.loads(check[1])
    for instruction in re.findall(r"^([A-Z]+) ", text, re.M):
        assert instruction in {"FROM", "WORKDIR", "COPY", "RUN", "USER", "ENV", "HEALTHCHECK", "STOPSIGNAL", "ENTRYPOINT",
                               "CMD"}
    assert words["ENTRYPOINT"] == ["compstiff"]
    if not shutil.which("flock"):
        pytest.skip("flock (util-linux) is not there: the container's health check asks it for the lock of the watch")
    with started(sys.executable, "-m", "compstiff", *words["CMD"], cwd=cell, stderr=subprocess.DEVNULL) as process:
        end = time.monotonic() + 60
        while subprocess.run(health, cwd=cell, capture_output=True).returncode != 0:
            assert process.poll() is None, "the watch ended"
            assert time.monotonic() < end, "the watch is not healthy after a minute"
            time.sleep(0.1)
        process.terminate()
        assert process.wait(timeout=300) == 0
    assert subprocess.run(health, cwd=cell, capture_output=True).returncode != 0


def test_the_container_installs_what_is_locked_and_that_is_all_it_needs() -> None:
    """A pin with its hash for every dependency, within the bounds of pyproject.toml; the file installs nothing else."""
    text = re.sub(r"\\\n", " ", (PIPELINE / "Dockerfile").read_text())
    project = tomllib.loads((PIPELINE.parents[1] / "pyproject.toml").read_text(encoding="utf-8"))
    for name, wanted in (("requirements", project["project"]["dependencies"]), ("build", project["build-system"]["requires"])):
        lines = (PIPELINE / f"{name}.lock").read_text().splitlines()
        assert lines[0].startswith("# Linux x86_64, CPython 3.12")
        pins = [re.fullmatch(r"([a-z0-9.-]+)==([^ ]+) --hash=sha256:[0-9a-f]{64}", line) for line in lines[1:]]
        assert all(pins)
        versions = {pin[1]: pin[2] for pin in pins if pin}
        assert len(versions) == len(pins)
        for requirement in map(Requirement, wanted):
            assert versions[canonicalize_name(requirement.name)] in requirement.specifier, requirement
        assert f"--require-hashes --only-binary :all: -r {name}.lock" in text
    assert re.findall(r"pip install (?!--require-hashes)(.*)", text) == ["--no-deps /wheel/*.whl"]


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion(shell: str, tmp_path: Path) -> None:
    """The script that a shell reads, and what it is told while somebody types `compstiff ident`."""
    where = environment(tmp_path)

    def asked(**more: str) -> str:
        return subprocess.run(["compstiff"], env=where | more, capture_output=True, text=True, timeout=300).stdout

    script = asked(_COMPSTIFF_COMPLETE=f"{shell}_source")
    assert "compstiff" in script
    assert f"_COMPSTIFF_COMPLETE={shell}_complete" in script
    words = ({"COMP_WORDS": "compstiff ident", "COMP_CWORD": "ident"} if shell == "fish" else
             {"COMP_WORDS": "compstiff ident", "COMP_CWORD": "1"})
    assert "identify" in asked(_COMPSTIFF_COMPLETE=f"{shell}_complete", **words)
    words = ({"COMP_WORDS": "compstiff init --robot", "COMP_CWORD": "irb66"} if shell == "fish" else
             {"COMP_WORDS": "compstiff init --robot irb66", "COMP_CWORD": "3"})
    robots = asked(_COMPSTIFF_COMPLETE=f"{shell}_complete", **words)
    assert "irb6660-205-1.90" in robots
    assert "kr60" not in robots


@pytest.mark.parametrize(("shell", "place", "asks"), [
    ("bash", ".bashrc", 'COMP_WORDS=(compstiff diagn)\nCOMP_CWORD=1\n_compstiff_completion compstiff diagn compstiff\n'
                        'echo "${COMPREPLY[@]}"'),
    # What completes, and what it is told; the editor of the line needs a terminal.
    ("zsh", ".zshrc", 'print $_comps[compstiff]; env COMP_WORDS="compstiff diagn" COMP_CWORD=1 '
                      '_COMPSTIFF_COMPLETE=zsh_complete compstiff'),
    ("fish", ".config/fish/completions/compstiff.fish", 'complete -C "compstiff diagn"')])
def test_shells_complete_with_the_lines_of_the_page(shell: str, place: str, asks: str, tmp_path: Path) -> None:
    """Each shell started with what docs/pipeline.md tells to write into its file, in an empty home: the word is completed."""
    if shutil.which(shell) is None:
        assert shell != "bash"
        pytest.skip(f"{shell} is not installed: its line on the page is not tried on this machine")
    page = (PIPELINE.parents[1] / "docs/pipeline.md").read_text(encoding="utf-8").partition("## Completion")[2]
    lines = re.findall(rf"```{shell}\n(.*?)```", page, re.S)
    assert len(lines) == 1
    home = str(tmp_path)
    where = environment(tmp_path) | {"HOME": home, "ZDOTDIR": home, "XDG_CONFIG_HOME": f"{home}/.config"}
    (tmp_path / place).parent.mkdir(parents=True, exist_ok=True)
    (tmp_path / place).write_text(lines[0])
    started = {"bash": f"source {place}\n{asks}"}.get(shell, asks)
    options = ["-i", "-c"] if shell == "zsh" else ["-c"]
    done = subprocess.run([shell, *options, started], env=where, cwd=tmp_path, capture_output=True, text=True, timeout=120,
                          stdin=subprocess.DEVNULL)
    assert "diagnose" in done.stdout, done.stderr
    assert "not found" not in done.stderr
    assert shell != "zsh" or "_compstiff_completion" in done.stdout


def test_turns_of_the_intermediate_file_are_those_of_the_pose() -> None:
    """robodk's KUKA angles against SciPy's: the test's own file says the poses that it means."""
    robomath = pytest.importorskip("robodk.robomath", reason="the extra test brings it")
    turn = Rotation.from_euler("ZYX", [20, -35, 70], degrees=True)
    pose = np.array(robomath.KUKA_2_Pose([1, 2, 3, 20, -35, 70]).rows)
    np.testing.assert_allclose(pose[:3, :3], turn.as_matrix(), atol=1e-12)
