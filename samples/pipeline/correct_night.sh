#!/usr/bin/env bash
# Every program of a cell folder that has its log beside it, for cron or a build server: checked first, then corrected.
#   correct_night.sh CELL-FOLDER [options of correct, such as --tare 0:2]
# Exit code: that of check, else the worst of all programs (docs/formats.md). One JSON line a program goes to corrected/night.jsonl.
set -uo pipefail
cell=$1
shift
compstiff check "$cell/cell.yaml" "$cell/stiffness_extended.json" "$cell/programs" "$@" || exit $?
mkdir -p "$cell/corrected"
compstiff correct "$cell/cell.yaml" "$cell/programs" --stiffness "$cell/stiffness_extended.json" "$@" \
    -o "$cell/corrected/" --offsets "$cell/corrected/" --report "$cell/corrected/" --force --json >"$cell/corrected/night.jsonl"
