#!/usr/bin/env bash
# Uses Umbel as other projects do: the static library, installed, by find_package; the sources by
# add_subdirectory, as a shared library; and that shared library, installed, by find_package. Each
# from C++ and from C.
set -euo pipefail
cd "$(dirname "$0")/.."

root=$PWD
work=$root/build/test_install
log=$work/log
rm -rf "$work/static" "$work/shared" "$work/use_static" "$work/use_shared"
mkdir -p "$work"

step() {
  local name=$1
  shift
  if ! "$@" >"$log" 2>&1; then
    cat "$log" >&2
    echo "test-install: $name: failed" >&2
    exit 1
  fi
  echo "test-install: $name: ok"
}

# The environment's oneTBB, where the build found that one.
tbb=$(sed -n 's/^TBB_DIR:[A-Z]*=//p' build/release/CMakeCache.txt)

use_package() {
  local prefix=$1 build=$2
  shift 2
  cmake -S tests/install/package -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=Release \
    -DCMAKE_PREFIX_PATH="$prefix" "$@"
  cmake --build "$build"
  # Only the installed copy may be used.
  if grep -q "$root/include" "$build/build.ninja"; then
    echo "the installed package points back into the source tree"
    return 1
  fi
  "$build/use_umbel"
  "$build/use_umbel_c"
}

# Nothing here asks for speed: without the optimiser it builds in a fraction of the time.
use_sources() {
  cmake -S tests/install/subdirectory -B "$work/subdirectory" -G Ninja -DCMAKE_BUILD_TYPE=Release \
    -DCMAKE_C_FLAGS_RELEASE="-O0 -DNDEBUG" -DCMAKE_CXX_FLAGS_RELEASE="-O0 -DNDEBUG" \
    -DUMBEL_SOURCE_DIR="$root" -DBUILD_SHARED_LIBS=ON -DUMBEL_INSTALL=ON -DTBB_DIR="$tbb"
  cmake --build "$work/subdirectory"
  "$work/subdirectory/use_umbel"
  "$work/subdirectory/use_umbel_c"
}

# A C program by the compiler alone; oneTBB may be in the environment's folder.
use_pkg_config() {
  local prefix=$1 program=$2 flags library
  flags=$(PKG_CONFIG_PATH="$prefix/lib/pkgconfig:$prefix/lib64/pkgconfig" \
    pkg-config --cflags --libs umbel)
  library=$(dirname "$(dirname "$tbb")")
  # shellcheck disable=SC2086  # flags are several words
  cc -std=c99 tests/install/use_umbel.c -o "$program" $flags -L"$library" \
    -Wl,-rpath,"$library:$prefix/lib:$prefix/lib64"
  "$program"
}

step "install the static library" \
  cmake --install build/release --prefix "$work/static" --component library
step "find_package, static library" use_package "$work/static" "$work/use_static" -DTBB_DIR="$tbb"
have_pkg_config=$(command -v pkg-config || true)
if [[ $have_pkg_config ]]; then
  step "pkg-config, static library" use_pkg_config "$work/static" "$work/use_pc_static"
fi
step "add_subdirectory, shared library" use_sources
step "install the shared library" \
  cmake --install "$work/subdirectory" --prefix "$work/shared" --component library
step "find_package, shared library" use_package "$work/shared" "$work/use_shared"
if [[ $have_pkg_config ]]; then
  step "pkg-config, shared library" use_pkg_config "$work/shared" "$work/use_pc_shared"
  echo "7 passed, 0 failed"
else
  echo "5 passed, 0 failed (without pkg-config)"
fi
