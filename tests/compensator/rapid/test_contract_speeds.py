"""Programmed speeds and zones."""

import numpy as np
import pytest

from tests.compensator.rapid.small_programs import found, path, target


def feed(text: str, declarations: str = "") -> float:
    return float(path(f"MoveL {target(1)},{text},fine,tool0;", declarations).feed[0])


def zone(text: str, declarations: str = "") -> float:
    return float(path(f"MoveL {target(1)},v100,{text},tool0;", declarations).zone[0])


@pytest.mark.parametrize("speed", [5, 10, 20, 30, 40, 50, 60, 80, 100, 150, 200, 300, 400, 500, 600, 800, 1000, 1500, 2000,
                                   2500,
                                   3000, 4000, 5000, 6000, 7000])
def test_predefined_speeds(speed):
    assert feed(f"v{speed}") == pytest.approx(speed / 1000, rel=1e-15)


@pytest.mark.parametrize(("text", "metres"), [("fine", 0), ("z0", 0.0003), ("z1", 0.001), ("z5", 0.005), ("Z10", 0.01),
                                              ("z15", 0.015), ("z20", 0.02), ("z30", 0.03), ("z40", 0.04), ("z50", 0.05),
                                              ("z60", 0.06), ("z80", 0.08), ("z100", 0.1), ("z150", 0.15), ("z200", 0.2)])
def test_predefined_zones(text, metres):
    assert zone(text) == pytest.approx(metres, rel=1e-15)


@pytest.mark.parametrize(("text", "declarations", "expected"), [
    ("[12.5,500,5000,1000]", "", 0.0125),
    ("vCut", "CONST speeddata vCut:=[33,500,5000,1000];", 0.033),
    ("vCut", "LOCAL CONST speeddata vCut:=v200;", 0.2),
    ("vCuts{2}", "CONST speeddata vCuts{2}:=[[1,2,3,4],[7,2,3,4]];", 0.007),
    ("vmax\\V:=250", "", 0.25),
    ("v100\\V:=slow", "CONST num slow:=8;", 0.008),
    ("v100", "CONST speeddata v100:=[55,500,5000,1000];", 0.055),
])
def test_speeds(text, declarations, expected):
    assert feed(text, declarations) == pytest.approx(expected, rel=1e-15)


@pytest.mark.parametrize(("text", "declarations"), [
    ("vmax", ""), ("vCut", ""), ("vCut", "VAR speeddata vCut;"), ("v100\\V:=slow", "VAR num slow:=8;"), ("Speed(3)", ""),
    ("vCut", "CONST speeddata vCut:=vCut;"), ("vCut", "PROC b()\nvCut.v_tcp:=3;\nENDPROC\nVAR speeddata vCut:=[1,2,3,4];"),
])
def test_unknown_speeds(text, declarations):
    toolpath = path(f"MoveL {target(1)},{text},fine,tool0;", declarations)
    assert np.isnan(toolpath.feed[0])
    finding, = found(toolpath, "CS2024")
    assert (finding.level, finding.target) == ("note", 0)
    assert toolpath.block[0] == ""


@pytest.mark.parametrize(("text", "declarations", "expected"), [
    ("[FALSE,2.5,15,15,1.5,15,1.5]", "", 0.0025),
    ("[TRUE,2.5,15,15,1.5,15,1.5]", "", 0.0),
    ("zCut", "CONST zonedata zCut:=[false,0.4,1,1,1,1,1];", 0.0004),
    ("zCut", "CONST zonedata zCut:=z5;", 0.005),
    ("fine\\Z:=0.7", "", 0.0007),
    ("z50\\Inpos:=inpos50", "", 0.0),
])
def test_zones(text, declarations, expected):
    assert zone(text, declarations) == pytest.approx(expected, rel=1e-15)


def test_unknown_zone():
    toolpath = path(f"MoveL {target(1)},v100,zMine,tool0;MoveL {target(1)},v50,zMine,tool0;")
    assert found(toolpath, "CS2024")[0].count == 2
    assert np.isnan(toolpath.zone[0])
    assert "zMine" in found(toolpath, "CS2024")[0].message
