"""One upload through the proxy with one fault, and what must be true afterwards, whatever the fault was."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from compensator.upload import session
from compensator.upload.address import Controller
from compensator.upload.upload import Wanted, upload
from identification.common.findings import CompstiffError
from identification.model.cell import read_cell
from tests.compensator.modbus.proxy import NO_FAULT, Fault
from tests.compensator.upload import kit
from tests.compensator.upload.emulator import PASSWORD, USER, Emulator, RobotController
from tests.compensator.upload.proxy import HttpProxy, faults

# Of a run with a fault, whose end is waited for; and of one without, which takes as long as a busy machine needs.
TIMEOUT_S, PATIENT_S = 0.3, 20.0
NEW, OLD, NOT_LOADED = "the new file is there, whole (read back)", "the new file is not there", "nothing was loaded"
NOTHING = "was sent"           # "nothing was sent", "no password was sent"
LOADED = b"MODULE Insert\r\nENDMODULE\r\n"


@dataclass(frozen=True)
class Run:
    """How one upload ended: exit code (0, 3, 4) and message."""

    code: int
    text: str


class Bench:
    """A controller behind the proxy, in a generation, uploading and loading; `replace`: in place of a module that is loaded."""

    def __init__(self, folder: Path, generation: int, *, replace: bool) -> None:
        session.FIRST_PAUSE_S, session.LEAST_INTERVAL_S = 0.002, 0.0
        self.folder, self.generation, self.replace = folder, generation, replace
        self.module = kit.write_module(folder, content=kit.module_text(moves=30))
        self.new, self.path = self.module.read_bytes(), kit.new_path(self.module)
        kit.authority().cert_pem.write_to_path(str(folder / "ca.pem"))
        self.controller = RobotController(generation)
        self.emulator = Emulator(self.controller)
        self.proxy = HttpProxy(self.emulator.port, kit.server_context() if generation == 2 else None)
        self.cell = read_cell(kit.cell_yaml(folder, self.proxy.port), geometry=False)

    def __enter__(self) -> Bench:
        self.emulator.__enter__()
        return self

    def __exit__(self, *_: object) -> None:
        self.proxy.__exit__()
        self.emulator.__exit__()

    def all_faults(self) -> list[Fault]:
        """Every fault of a run, from the sizes of one without."""
        assert self.run(NO_FAULT).code == 0
        return faults(self.proxy.sizes)

    def run(self, fault: Fault) -> Run:
        """The controller as before the first upload, then one through the fault."""
        self.proxy.arm(fault)
        controller = self.controller
        controller.files, controller.sessions, controller.holder, controller.log = {}, set(), None, []
        controller.tasks["T_ROB1"]["modules"] = {"BASE": b"", **({"Insert": LOADED} if self.replace else {})}
        return self.upload(self.proxy.port, PATIENT_S if fault == NO_FAULT else TIMEOUT_S)

    def replace_again(self) -> None:
        """The next upload may exchange the module, whichever is loaded."""
        self.controller.tasks["T_ROB1"]["modules"] = {"BASE": b"", **({"Insert": LOADED} if self.replace else {})}

    def upload(self, port: int, timeout_s: float = PATIENT_S) -> Run:
        """One call of the library, as the command makes it."""
        address = Controller("127.0.0.1", USER, PASSWORD, tls=self.generation == 2, port=port, ca=self.folder / "ca.pem",
                             timeout_s=timeout_s, retries=1)
        try:
            result = upload(self.cell, self.module, address, apply=True, wanted=Wanted(task="T_ROB1", replace=self.replace))
        except CompstiffError as stopped:
            return Run(stopped.exit_code, stopped.findings[0].message)
        return Run(0, "; ".join(result.endings))

    def check(self, fault: Fault, run: Run) -> None:
        """The file is there whole or not at all, the module that is loaded is the old or the new one, the answer is true."""
        controller = self.controller
        self.proxy.settle()
        files = {name: content for name, content in controller.files.items() if not name.endswith(".part")}
        if fault.kind == "corrupt request" and run.code == 4:
            # A changed byte in the request that renames, which TLS does not let through: another name, and that is not claimed.
            files = {name: content for name, content in files.items() if name == self.path}
        assert files in ({}, {self.path: self.new}), (fault, run)
        loaded = controller.loaded().get("Insert")
        before = LOADED if self.replace else None
        assert loaded in (before, self.new), (fault, run)
        assert all(allowed(method, path) for method, path in controller.log), (fault, controller.log)
        # Renaming, asking for mastership and loading are never repeated.
        once = [path for method, path in controller.log if method == "POST" and "release" not in path]
        assert len(once) - len(set(once)) <= (fault.kind == "duplicate request"), (fault, once)
        if run.code == 0:
            assert files, (fault, run)
            assert loaded == self.new, (fault, run)
        if NEW in run.text:
            assert files, (fault, run)
        old = OLD in run.text or NOTHING in run.text
        if old:
            assert not files, (fault, run)
        if old or NOT_LOADED in run.text:
            assert loaded == before, (fault, run)
        if run.code:
            assert NEW in run.text or old or "state unknown" in run.text, (fault, run)
        if "state unknown" in run.text:
            assert run.code == 4, (fault, run)


def allowed(method: str, path: str) -> bool:
    """What an upload may ask a controller for: nothing that starts, stops or moves."""
    if method == "GET":
        return True
    if path.startswith("/fileservice/"):
        return True
    return method == "POST" and any(word in path for word in ("/rw/mastership/", "loadmod"))
