#!/usr/bin/env bash
# What `make cuda` does: builds umbel::cuda, its tests and its benchmarks in build/release, with the CUDA
# toolkit that is installed (nvcc on the PATH, or CUDACXX), or else with one made of wheels in
# build/cuda-toolkit. No GPU is needed.
#
#   CUDA_ARCHS="90" scripts/cuda.sh     builds for these architectures only
set -euo pipefail
cd "$(dirname "$0")/.."

fail() {
  printf 'cuda: %s\n' "$*" >&2
  exit 1
}

# The wheels become a toolkit by the two links that a linker and CMake look for.
toolkit_of_wheels() {
  local venv=build/cuda-toolkit
  if ! cmp -s scripts/requirements-cuda.txt "$venv/requirements.txt"; then
    echo "cuda: installing the CUDA toolkit as wheels into $venv (some 300 MB)" >&2
    rm -rf "$venv"
    "${PYTHON:-python3}" -m venv "$venv"
    "$venv/bin/python" -m pip install --quiet --disable-pip-version-check \
      -r scripts/requirements-cuda.txt >&2 || fail "pip could not install the CUDA wheels"
    cp scripts/requirements-cuda.txt "$venv/requirements.txt"
  fi
  local root
  root=$("$venv/bin/python" -c 'import nvidia, pathlib; print(pathlib.Path(list(nvidia.__path__)[0]) / "cu13")')
  ln -sfn lib "$root/lib64"
  ln -sfn libcudart.so.13 "$root/lib/libcudart.so"
  echo "$root"
}

mkdir -p build
arguments=()
if [[ -z ${CUDACXX:-} ]] && ! command -v nvcc >/dev/null 2>&1; then
  root=$(toolkit_of_wheels)
  arguments+=("-DCMAKE_CUDA_COMPILER=$root/bin/nvcc" "-DCUDAToolkit_ROOT=$root")
fi
if [[ -n ${CUDA_ARCHS:-} ]]; then
  arguments+=("-DCMAKE_CUDA_ARCHITECTURES=${CUDA_ARCHS// /;}")
fi
if command -v ccache >/dev/null 2>&1; then
  arguments+=(-DCMAKE_CUDA_COMPILER_LAUNCHER=ccache)
fi
# oneTBB may be a wheel in .venv.
if [[ -x .venv/bin/python ]]; then
  arguments+=("-DPython_EXECUTABLE=$PWD/.venv/bin/python")
fi

build=build/release
configure=(cmake --preset release)
if [[ -f $build/CMakeCache.txt ]]; then configure=(cmake "$build"); fi
log=build/cuda-configure.log
if ! "${configure[@]}" -DUMBEL_CUDA=ON -DUMBEL_BUILD_TESTS=ON -DUMBEL_BUILD_BENCH=ON \
  -DUMBEL_WERROR="${UMBEL_WERROR:-OFF}" "${arguments[@]}" "$@" >"$log" 2>&1; then
  tail -n 20 "$log" >&2
  fail "CMake failed; the log is $log"
fi
grep -E '^-- CUDA [0-9]' "$log"
cmake --build "$build" --target umbel_cuda umbel_cuda_c umbel_cuda_tests cuda_frame_example cuda_bench cuda_bvh_bench \
  cuda_paths_bench cuda_query_bench
