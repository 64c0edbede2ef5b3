#!/usr/bin/env bash
# Installs what the tests need into a virtual environment of its own and runs them, after lint and types; beside them, on the
# newest Python at hand, the demo from a wheel in an empty environment. Called from the README and by .ci/run.
#     bash tests/run.sh               what a change must pass: without the tests that took longest (tests/slow.txt)
#     bash tests/run.sh --slow        with these, a part of all on the newest Python too, and a picture of every report
#     bash tests/run.sh --long        with those besides that tell what a faster one tells in small
# Other words are for pytest.
set -euo pipefail
cd "$(dirname "$0")/.."
python=${PYTHON:-python3}
work=$(mktemp -d)
whole=
for word in "$@"; do case $word in --slow | --long) whole=yes ;; esac; done
beside=
trap '[ -z "$beside" ] || kill -- "-$beside" 2>/dev/null || true; rm -rf "$work"' EXIT
environment=${COMPSTIFF_TEST_ENV:-$work/test}

# Of the packages that come along most files are never imported: what is gets compiled then.
export PIP_NO_COMPILE=1 PIP_DISABLE_PIP_VERSION_CHECK=1

# Measured records that are not part of the project: tests that need them skip where they are not there.
if [ -z "${COMPSTIFF_REAL_DATA:-}" ] && [ -d ../shared/data ]; then
    COMPSTIFF_REAL_DATA=$(cd ../shared/data && pwd)
    export COMPSTIFF_REAL_DATA
fi

# Hundreds of processes start: each would compile every file anew.
unset PYTHONDONTWRITEBYTECODE

# Matrices of six by six: threads of the linear algebra only get into the way of the test processes.
export OPENBLAS_NUM_THREADS=1

# Memory that is given back to the system and fetched again takes a few per cent of the CPU time.
export MALLOC_TRIM_THRESHOLD_=268435456 MALLOC_MMAP_THRESHOLD_=33554432 MALLOC_TOP_PAD_=16777216

newest() {
    local minor python
    for minor in 14 13 12; do
        for python in "python3.$minor" "${PYENV_ROOT:-$HOME/.pyenv}"/versions/3."$minor".*/bin/python; do
            if "$python" -c '' 2>/dev/null; then echo "$python"; return; fi
        done
    done
}

# install INTO WHAT...: uv installs in a tenth of pip's time. Where it is not to be had, or finds less than pip as that is set up
# here, pip installs.
install() {
    local into=$1
    shift
    "$work/uv/bin/uv" pip install --quiet --python "$into/bin/python" "$@" 2>/dev/null || "$into/bin/pip" install --quiet "$@"
}

# The program from a wheel in an environment of its own, which begins while that of the tests is being installed: on the newest
# Python at hand, since what differs between Pythons shows there first. What that part of the tests needs comes after the demo.
beside_the_tests() {
    local newest empty="$work/empty/bin"
    newest=$(newest)
    "${newest:-$python}" -m venv "$work/empty"
    echo "== the demo from a wheel, in an empty environment, on $("$empty/python" --version)"
    "$empty/pip" wheel --quiet --no-deps --wheel-dir "$work/wheel" .
    install "$work/empty" "$work"/wheel/*.whl
    (cd "$work" && empty/bin/compstiff demo demo && ls demo/insert_corrected.mod demo/correct.html >/dev/null)

    # Reading, files, effects and a command: the packages of the checkout, which lies before those of the wheel. Not the demo
    # again, and no laws that are arithmetic alone, the same on every Python.
    if [ -n "$newest" ] && [ -n "$whole" ]; then
        install "$work/empty" pytest hypothesis mujoco rapidchecker
        "$empty/python" -m pytest -q -p no:cacheprovider tests/compensator/rapid tests/identification/model \
            --ignore=tests/identification/model/test_laws_{kinematics,compliance,robots,soft_track}.py \
            tests/without_posix tests/runs/command_line/test_identify.py
    fi
}

{ "$python" -m venv "$work/uv" && "$work/uv/bin/pip" install --quiet uv; } 2>/dev/null || true

# A group of processes of its own, so that all of it ends where this ends; -e counts in it because nobody asks for its outcome here.
set -m
(beside_the_tests) >"$work/beside.txt" 2>&1 &
beside=$!
set +m

"$python" -m venv "$environment"
install "$environment" -e '.[test,samples,benchmark]'
# A package whose text makes Python warn when it is compiled, which is an error in the tests: compiled here.
"$environment/bin/python" -W ignore -c 'import toppra'

echo "== lint"
"$environment/bin/ruff" check .

# A browser for the tests of reports, below the user's cache folder. Without Node.js or the npm registry they skip, and say so.
if [ -z "${COMPSTIFF_BROWSER:-}" ] && browser=$("$environment/bin/python" tests/runs/reports/fetch_chromium.py); then
    export COMPSTIFF_BROWSER=$browser
fi
echo "== the browser for the tests of reports: ${COMPSTIFF_BROWSER:-none}"

# A picture of every report, for people to look at: on a screen, in the dark, on a telephone and on paper.
if [ -n "$whole" ]; then
    export COMPSTIFF_SCREENSHOTS=${COMPSTIFF_SCREENSHOTS:-$PWD/build/screenshots}
    mkdir -p "$COMPSTIFF_SCREENSHOTS"
fi

# Types, beside the tests; told after them.
"$environment/bin/mypy" >"$work/types.txt" 2>&1 &
types=$!

# Every test process imports all tests, and would compile them anew if none had before: a fourth of a minute each. What cannot
# be imported is told by the tests.
"$environment/bin/python" -m pytest --collect-only -q >/dev/null 2>&1 || true

# Three processes for two cores: some wait, for a reply or a lock.
echo "== tests"
failed=0
"$environment/bin/python" -m pytest -n 3 --dist loadfile --no-loadscope-reorder "$@" || failed=$?
echo "== types"
wait "$types" || failed=$?
cat "$work/types.txt"
wait "$beside" || { failed=$?; cat "$work/beside.txt"; }
beside=
exit "$failed"
