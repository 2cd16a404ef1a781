#!/usr/bin/env bash
# Builds the Python package in build/release, the build folder that the C++ tests use too, and
# installs it into .venv. Arguments are passed on to pip.
set -euo pipefail
cd "$(dirname "$0")/.."

log=build/package.log
echo "setup: building the package into .venv (the first time takes some minutes)"
mkdir -p build
started=$SECONDS
if ! .venv/bin/python -m pip install --disable-pip-version-check --no-build-isolation . \
  -C build-dir=build/release \
  -C cmake.define.CMAKE_EXPORT_COMPILE_COMMANDS=ON \
  -C cmake.define.UMBEL_BUILD_TESTS=ON \
  -C cmake.define.UMBEL_BUILD_BENCH=ON \
  -C cmake.define.UMBEL_WERROR="${UMBEL_WERROR:-OFF}" \
  --verbose "$@" >"$log" 2>&1; then
  grep -nE 'error|Error|FAILED' "$log" | head -n 20 >&2 || true
  echo "setup: the package could not be built; the whole log is $log" >&2
  exit 1
fi
grep -E '^ *-- (oneTBB|meshoptimizer)' "$log" || true
echo "setup: .venv/bin/umbel is ready ($((SECONDS - started)) s)"
