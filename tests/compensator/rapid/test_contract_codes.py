"""Findings of RAPID are plain values, ready for JSON."""

import json

from tests.compensator.rapid.small_programs import path, shift, target


def test_findings_are_plain_values():
    body = (f"PDispOn p,tool0;MoveL {target(q='[0,0,0,0]')},vx,zx,t\\WObj:=w\\Corr;PDispOff;TriggL p,v5,g,z1,tool0;"
            f"MoveL *,v5,z1,tool0;MoveL {target(q='[0.707,0,0.707,0]')},v5,z1,tool0;")
    toolpath = path(body)
    written = shift(f"MoveL Offs({target()},0,0,1),v5,z1,tool0;", [0], [[1, 0, 0]], confdata=[[1, 0, 0, 0]])
    plain = json.loads(json.dumps([finding.as_dict() for finding in (*toolpath.findings, *written.findings)]))
    assert [finding["code"] for finding in plain] == [
        "CS2010", "CS2012", "CS2013", "CS2014", "CS2015", "CS2020", "CS2021", "CS2024", "CS2024", "CS2016", "CS2042", "CS2040"]
