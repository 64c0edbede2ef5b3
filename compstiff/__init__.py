"""compstiff makes industrial robots mill accurately. Its whole chain, for scripts; names load on first use.

    import compstiff

    cell = compstiff.read_cell("cell.yaml")
    fit = compstiff.fit_stiffness(cell, compstiff.read_measurements("measurements.csv", cell.robot))
    toolpath = compstiff.read_toolpath("part.mod", cell)
    corrected = compstiff.correct(compstiff.predict(cell, toolpath, fit.model, "part.forces.csv"))
    compstiff.write({"part_corrected.mod": corrected.content, "correct.html": compstiff.report(corrected)})

Lengths are in metres, angles in radians, forces in newton, frames named by direction (`base_from_tcp`); what differs has
its unit in the name. What is wrong with a file is raised as `CompstiffError`, with file, line, column and a hint; every result
has `findings` (what to know before trusting it), `as_dict()` and `lines()`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from compensator.coefficients.fit import cutting_coefficients, table_coefficients
    from compensator.correction.budget import error_budget
    from compensator.correction.correct import correct
    from compensator.correction.files import Inputs, Outputs, correct_files
    from compensator.correction.offsets import deviation_csv, offsets_csv
    from compensator.correction.predict import predict
    from compensator.correction.settings import Settings
    from compensator.forces.log import read_force_log
    from compensator.forces.tare import still_payload
    from compensator.learned.learned_file import read_learned
    from compensator.learning.learn import learn
    from compensator.modbus.link import Address
    from compensator.modbus.offset_file import read_offsets
    from compensator.modbus.push import push
    from compensator.posting.job import post_files
    from compensator.posting.read_toolpath import read_toolpath
    from compensator.upload.address import Controller
    from compensator.upload.upload import upload
    from compensator.verification.verify import verify
    from compstiff.batch.pairing import Folders, paired
    from compstiff.batch.programs import Shared
    from compstiff.batch.running import correct_programs
    from compstiff.batch.watch import watch_folder
    from compstiff.cell_folder import CellAnswers, new_cell
    from compstiff.file_checks import check_files
    from compstiff.poses_of_program import milling_poses
    from compstiff.writing import report, write
    from identification.common.catalogue import explain_code
    from identification.common.findings import CompstiffError, Finding
    from identification.design.procedure import design_plan
    from identification.design.request import Request
    from identification.diagnosis.diagnose import Unfitted, diagnose
    from identification.diagnosis.plan import judge_plan
    from identification.fit.fit import fit_stiffness
    from identification.formats.convert import convert_log
    from identification.measurements import read_measurements
    from identification.model.cell import read_cell
    from identification.model.robot import built_in_robots
    from identification.model.robot_check import check_robot
    from identification.model.stiffness_file import read_stiffness
    from identification.motion.diagnosis import diagnose_joint_logs
    from identification.motion.fit import fit_joint_logs
    from identification.motion.log_file import read_motion_log

# The file of each name, as the imports above say it to the type checker (a test compares them).
_FILES = {
    "compensator.coefficients.fit": ("cutting_coefficients", "table_coefficients"),
    "compensator.correction.budget": ("error_budget",),
    "compensator.correction.correct": ("correct",),
    "compensator.correction.files": ("Inputs", "Outputs", "correct_files"),
    "compensator.correction.offsets": ("deviation_csv", "offsets_csv"),
    "compensator.correction.predict": ("predict",),
    "compensator.correction.settings": ("Settings",),
    "compensator.forces.log": ("read_force_log",),
    "compensator.forces.tare": ("still_payload",),
    "compensator.learned.learned_file": ("read_learned",),
    "compensator.learning.learn": ("learn",),
    "compensator.modbus.link": ("Address",),
    "compensator.modbus.offset_file": ("read_offsets",),
    "compensator.modbus.push": ("push",),
    "compensator.posting.job": ("post_files",),
    "compensator.posting.read_toolpath": ("read_toolpath",),
    "compensator.upload.address": ("Controller",),
    "compensator.upload.upload": ("upload",),
    "compensator.verification.verify": ("verify",),
    "compstiff.batch.pairing": ("Folders", "paired"),
    "compstiff.batch.programs": ("Shared",),
    "compstiff.batch.running": ("correct_programs",),
    "compstiff.batch.watch": ("watch_folder",),
    "compstiff.cell_folder": ("CellAnswers", "new_cell"),
    "compstiff.file_checks": ("check_files",),
    "compstiff.poses_of_program": ("milling_poses",),
    "compstiff.writing": ("report", "write"),
    "identification.common.catalogue": ("explain_code",),
    "identification.common.findings": ("CompstiffError", "Finding"),
    "identification.design.procedure": ("design_plan",),
    "identification.design.request": ("Request",),
    "identification.diagnosis.diagnose": ("Unfitted", "diagnose"),
    "identification.diagnosis.plan": ("judge_plan",),
    "identification.fit.fit": ("fit_stiffness",),
    "identification.formats.convert": ("convert_log",),
    "identification.measurements": ("read_measurements",),
    "identification.model.cell": ("read_cell",),
    "identification.model.robot": ("built_in_robots",),
    "identification.model.robot_check": ("check_robot",),
    "identification.model.stiffness_file": ("read_stiffness",),
    "identification.motion.diagnosis": ("diagnose_joint_logs",),
    "identification.motion.fit": ("fit_joint_logs",),
    "identification.motion.log_file": ("read_motion_log",),
}
_FILE_OF = {name: file for file, names in _FILES.items() for name in names}
__all__ = [
    "Address", "CellAnswers", "CompstiffError", "Controller", "Finding", "Folders", "Inputs", "Outputs", "Request",
    "Settings", "Shared", "Unfitted", "built_in_robots", "check_files", "check_robot", "convert_log", "correct",
    "correct_files", "correct_programs", "cutting_coefficients", "design_plan", "deviation_csv", "diagnose",
    "diagnose_joint_logs", "error_budget", "explain_code", "fit_joint_logs", "fit_stiffness", "judge_plan", "learn",
    "milling_poses", "new_cell", "offsets_csv", "paired", "post_files", "predict", "push", "read_cell", "read_force_log",
    "read_learned", "read_measurements", "read_motion_log", "read_offsets", "read_stiffness", "read_toolpath", "report",
    "still_payload", "table_coefficients", "upload", "verify", "watch_folder", "write",
]


def __getattr__(name: str) -> Any:
    from importlib import import_module

    if name not in _FILE_OF:
        raise AttributeError(f"module 'compstiff' has no attribute '{name}'")
    value = globals()[name] = getattr(import_module(_FILE_OF[name]), name)
    return value


def __dir__() -> list[str]:
    return [*__all__, *globals()]
