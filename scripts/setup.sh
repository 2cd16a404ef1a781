#!/usr/bin/env bash
# What `make setup` does before the package is built: the system packages that are missing (with
# apt-get, where this user may), the virtual environment .venv, and the pinned tools in it.
# Cheap when there is nothing to do.
set -euo pipefail
cd "$(dirname "$0")/.."

log=build/setup.log
mkdir -p build

fail() {
  printf 'setup: %s\n' "$*" >&2
  exit 1
}

# Runs a command with its output in the log; when it fails, shows the end of that.
quietly() {
  if ! "$@" >"$log" 2>&1; then
    tail -n 15 "$log" >&2
    return 1
  fi
}

have() { command -v "$1" >/dev/null 2>&1; }

python=${PYTHON:-python3}

# ---- system packages ---------------------------------------------------------------------------

# True if the compiler finds the header.
have_header() {
  printf '#if !__has_include(<%s>)\n#error\n#endif\n' "$1" |
    "${CXX:-c++}" -x c++ -E - >/dev/null 2>&1
}

missing=()
if ! have "${CXX:-c++}"; then missing+=(g++); fi
if ! have cmake; then missing+=(cmake); fi
if ! have ninja; then missing+=(ninja-build); fi
if ! have git; then missing+=(git); fi
if ! have "$python"; then missing+=(python3 python3-venv python3-dev); fi
if have "$python" && ! "$python" -c 'import ensurepip, venv' 2>/dev/null; then
  missing+=(python3-venv)
fi
if have "$python" && ! "$python" - <<'PY' 2>/dev/null
import pathlib, sysconfig, sys
sys.exit(not pathlib.Path(sysconfig.get_path("include"), "Python.h").exists())
PY
then
  missing+=(python3-dev)
fi
if ! have "${CXX:-c++}" || ! have_header gtest/gtest.h; then missing+=(libgtest-dev); fi
if ! have "${CXX:-c++}" || ! have_header tbb/version.h; then missing+=(libtbb-dev); fi

if ((${#missing[@]})); then
  if [[ $(id -u) == 0 ]] && have apt-get; then
    echo "setup: installing ${missing[*]} with apt-get"
    export DEBIAN_FRONTEND=noninteractive
    quietly apt-get update || fail "apt-get update failed; the log is $log"
    quietly apt-get install -y --no-install-recommends "${missing[@]}" ||
      fail "apt-get could not install ${missing[*]}; the log is $log"
  elif have apt-get; then
    fail "these packages are missing: run 'sudo apt-get install ${missing[*]}' and try again"
  else
    fail "install what these Debian packages hold and try again: ${missing[*]}"
  fi
fi

# The viewer's tests in a browser want one; without it they are left out.
if have npm && ! have chromium && [[ $(id -u) == 0 ]] && have apt-get; then
  echo "setup: installing chromium with apt-get"
  export DEBIAN_FRONTEND=noninteractive
  { quietly apt-get update && quietly apt-get install -y --no-install-recommends chromium; } ||
    echo "setup: apt-get could not install chromium; the log is $log"
fi

"$python" -c 'import sys; sys.exit(sys.version_info < (3, 10))' ||
  fail "Umbel needs Python 3.10 or newer, and $python is $("$python" --version 2>&1);" \
       "name another with PYTHON=..."

# ---- the virtual environment -------------------------------------------------------------------

if ! .venv/bin/python -c 'import pip' >/dev/null 2>&1; then
  echo "setup: making .venv with $("$python" --version)"
  rm -rf .venv
  quietly "$python" -m venv .venv || fail "$python could not make a virtual environment in .venv"
fi
if ! cmp -s scripts/requirements.txt .venv/requirements.txt; then
  echo "setup: installing the pinned tools into .venv"
  quietly .venv/bin/python -m pip install --disable-pip-version-check -r scripts/requirements.txt ||
    fail "pip could not install scripts/requirements.txt; the log is $log"
  cp scripts/requirements.txt .venv/requirements.txt
fi
