"""Sound files for the doors that are fuzzed (fuzz_doors.py), and the cell they belong to."""

from __future__ import annotations

import io
import json
import struct
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.unbreakable import CELL
from tests.runs.command_line.workshop import workshop

ROBOT = "irb6660-205-1.90"
E = "[9E9,9E9,9E9,9E9,9E9,9E9]"


@cache
def cell(folder: Path) -> Any:
    """The cell that the files belong to."""
    from identification.model.cell import read_cell

    folder.mkdir(parents=True, exist_ok=True)
    file = folder / "sound-cell.yaml"
    file.write_text(CELL)
    return read_cell(file)


def joint_log_text() -> str:
    t = np.arange(400) / 250.0
    angle, torque = 20 * np.sin(3 * t), 300 * np.cos(2 * t)
    rows = "\n".join(f"{a:.4f},{b:.5f},{c:.5f},{d:.3f}" for a, b, c, d in
                     zip(t, angle, angle - 1e-4 * torque, torque, strict=True))
    return "time_s,q2_motor_deg,q2_link_deg,q2_torque_nm\n" + rows + "\n"


def learned_text(folder: Path) -> str:
    from compensator.learned.learned import DRIFT, SETUP

    robot, count = cell(folder).robot, 6 + SETUP + DRIFT + 3
    return json.dumps({
        "format": "compstiff-learned", "version": 1, "robot": robot.name, "robot_sha256": robot.sha256,
        "geometry_sha256": robot.geometry_sha256, "told": {}, "springs": 6,
        "job": {"position_mm": [900, 50, 400], "quaternion": [1, 0, 0, 0], "centre_mm": [600, 20, 5], "radius_mm": 60,
                "duration_s": 30},
        "remainder": {"length_mm": 40, "amplitude_um": 12, "places_mm": [[600, 20, 5]], "posture_deg": [[1, 2, 3, 4, 5, 6]]},
        "prior": [-14.0] * 6, "mean": [0.01] * count,
        "covariance": [[0.0] * row + [1e-4] for row in range(count)]}, indent=1)


DIAGNOSIS = json.dumps({
    "format": "compstiff-diagnosis", "version": 1, "robot": ROBOT, "verdict": "ambiguous",
    "alternatives": [{"effect": "backlash", "joint": 2}, {"effect": "soft_zone", "joint": 3}],
    "causes": [{"parameters": {"single_row": {"estimate": 4}}}], "visits": {"bad": [{"rows": [1, 2]}]}}, indent=1)
LVM = ("LabVIEW Measurement\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\nDecimal_Separator\t.\nMulti_Headings\tNo\n"
       "X_Columns\tOne\n***End_of_Header***\n\nChannels\t3\nSamples\t4\t4\t4\nY_Unit_Label\tN\tN\tN\nX0\t0\t0\t0\n"
       "Delta_X\t0.001\t0.001\t0.001\n***End_of_Header***\nX_Value\tFx\tFy\tFz\tComment\n"
       + "".join(f"{k / 1000}\t{k}.5\t-{k}\t{3 * k}\n" for k in range(4)))
METALLICADOUR = "".join(",".join(f"{(k * c) % 7 - 3.25:.3f}" for c in range(12)) + "\n" for k in range(60))
NET_FT = b"".join(struct.pack(">IIIiiiiii", k, 7 * k, 0, 10**6 * k, -k, 5, 1, 2, 3) for k in range(20))
JOURNAL = ('{"format": "compstiff-watch", "version": 1, "time": "2026-01-01T00:00:00+00:00", "event": "begun", '
           '"program": "a.mod", "key": "k", "outputs": ["a.mod", "a.csv"]}\n'
           '{"event": "done", "program": "a.mod", "key": "k", "exit_code": 0}\n')
POINTS = "x_mm,y_mm,z_mm,dx_um,dy_um,dz_um,std_um\n10,20,-1,5,,-7,3\n11,20,-1,6,2,-8,4\n"
NORMALS = "x_mm,y_mm,z_mm,nx,ny,nz,dn_um,target\n10,20,-1,0,0.6,0.8,12,\n11,20,-1,0,0,1,-4,7\n"
OFFSETS = "# compstiff\ntarget,ox_mm,oy_mm,oz_mm\n" + "".join(f"{k},0.0{k},-0.1,0.002\n" for k in range(6))
NAMED = f"""MODULE Part
  CONST robtarget p10:=[[600.1,20,5],[0,1,0,0],[0,0,0,0],{E}];
  LOCAL PERS robtarget p20:=[[610,20,5],[0,1,0,0],[0,0,0,0],{E}];
  CONST robtarget pts{{2}}:=[p10,[[4,5,6],[1,0,0,0],[0,0,0,0],{E}]];
  CONST robtarget p30:=p10;
  VAR num n:=1;
  PROC main()
    VAR robtarget p40:=[[620,20,5],[0,1,0,0],[0,0,0,0],{E}];
    MoveJ p10,v100,fine,tool0;
    MoveL p20,v50,z1,tool0;
    MoveL P20,v50,z1,tool0; ! again
    MoveL p40,v50,z1,tool0\\WObj:=wobj0;
    MoveC p30,pts{{2}},v50,z1,tool0;
    MoveL Offs(p10,0,0,50),v50,z1,tool0;
    MoveL RelTool(p20,1,2,3\\Rz:=90),v50,z1,tool0;
    MoveL pts{{n}},v50,z1,tool0;
    MoveAbsJ [[1,2,3,4,5,6],{E}],v50,z1,tool0;
    TriggL p20,v50,gun,z1,tool0;
    IF n>1 MoveL p10,v50,z1,tool0;
    sub p10;
  ENDPROC
  PROC sub(robtarget p)
    MoveL p,v50,z1,tool0;
  ENDPROC
ENDMODULE
"""


def workbook() -> bytes:
    import openpyxl

    book = openpyxl.Workbook()
    sheet = book.active
    for line in workshop(ROBOT).files["measurements.csv"].splitlines()[:8]:
        sheet.append([float(cell) if cell[-1].isdigit() else cell for cell in line.split(",")])
    stream = io.BytesIO()
    book.save(stream)
    return stream.getvalue()


def parquet() -> bytes:
    import pandas as pd

    stream = io.BytesIO()
    pd.DataFrame({"target": np.arange(20) // 5, "fx_n": np.arange(20.0), "fy_n": 1.0, "fz_n": -2.5}).to_parquet(stream)
    return stream.getvalue()


def matlab() -> bytes:
    from scipy.io import savemat

    stream = io.BytesIO()
    t = np.arange(60) / 250.0
    angle = np.sin(t * np.arange(1, 7)[:, None])
    savemat(stream, {"rec": {"time_cont": t, "act_pos_mot_deg": angle, "act_pos_se_deg": 0.999 * angle,
                             "act_vel_mot_deg_per_s": np.cos(angle), "act_torque_abs_nm": 3 * angle},
                     "para": {"u": np.full(6, 200.0)}})
    return stream.getvalue()
