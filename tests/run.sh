#!/usr/bin/env bash
# Installs what the tests need into a virtual environment of its own and runs them all: lint, types, tests, and the demo
# from a wheel in an empty environment. Called from the README and by .ci/run.
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

echo "== tests"
"$environment/bin/python" -m pytest -n 2 --dist loadfile
