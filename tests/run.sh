#!/usr/bin/env bash
# Installs what the tests need into a virtual environment of its own and runs them all: lint, types, the demo from a wheel in an
# empty environment, a part of the tests on the newest Python at hand, and all of them. Called from the README and by .ci/run.
set -euo pipefail
cd "$(dirname "$0")/.."
python=${PYTHON:-python3}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
environment=${COMPSTIFF_TEST_ENV:-$work/test}

"$python" -m venv "$environment"
"$environment/bin/pip" install --quiet --disable-pip-version-check -e '.[test,samples,benchmark]'

echo "== lint and types"
"$environment/bin/ruff" check .
"$environment/bin/mypy"

echo "== the demo from a wheel, in an empty environment"
"$environment/bin/python" -m build --quiet --wheel --outdir "$work/wheel" .
"$python" -m venv "$work/empty"
"$work/empty/bin/pip" install --quiet --disable-pip-version-check "$work"/wheel/*.whl
(cd "$work" && empty/bin/compstiff demo demo && ls demo/insert_corrected.mod demo/correct.html >/dev/null)

# Measured records that are not part of the project: tests that need them skip where they are not there.
if [ -z "${COMPSTIFF_REAL_DATA:-}" ] && [ -d ../shared/data ]; then
    COMPSTIFF_REAL_DATA=$(cd ../shared/data && pwd)
    export COMPSTIFF_REAL_DATA
fi

# Matrices of six by six: threads of the linear algebra only get into the way of the two test processes.
export OPENBLAS_NUM_THREADS=1

# Reading, geometry and the two commands on the newest Python at hand: what differs between Pythons shows there first.
newest() {
    local minor python
    for minor in 14 13 12; do
        for python in "python3.$minor" "${PYENV_ROOT:-$HOME/.pyenv}"/versions/3."$minor".*/bin/python; do
            if "$python" -c '' 2>/dev/null; then echo "$python"; return; fi
        done
    done
}
newest=$(newest)
if [ -n "$newest" ]; then
    echo "== on $("$newest" --version)"
    "$newest" -m venv "$work/newest"
    "$work/newest/bin/pip" install --quiet --disable-pip-version-check -e '.[test]'
    "$work/newest/bin/python" -m pytest -q -n 2 tests/compensator/rapid tests/identification/model tests/without_posix \
        tests/runs/command_line/test_demo.py tests/runs/command_line/test_identify.py >"$work/newest.txt" 2>&1 \
        || { cat "$work/newest.txt"; exit 1; }
fi

# A browser for the tests of reports, below the user's cache folder. Without Node.js or the npm registry they skip, and say so.
if [ -z "${COMPSTIFF_BROWSER:-}" ] && browser=$("$environment/bin/python" tests/runs/reports/fetch_chromium.py); then
    export COMPSTIFF_BROWSER=$browser
fi
echo "== the browser for the tests of reports: ${COMPSTIFF_BROWSER:-none}"

echo "== tests"
"$environment/bin/python" -m pytest -n 2 --dist loadfile --no-loadscope-reorder
