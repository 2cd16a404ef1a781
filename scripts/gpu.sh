#!/usr/bin/env bash
# What `make gpu` does, on a machine with a GPU, nvcc, CMake and ninja, and without a network: builds
# with CUDA, runs the tests on the device, the benchmarks, the small tests again under
# compute-sanitizer's memcheck and racecheck, and those of arrays of PyTorch, CuPy and Numba where
# Python has them. Writes bench/results/gpu-<device>*, and after every step packs that and the logs
# into gpu-results.tar.gz in $OUT, if there is such a folder. What does not end within eight minutes
# is cut off, and said to have failed.
#
# What CMake would download elsewhere is taken from build/gpu-carry, which `make gpu-carry` fills on a
# machine with a network (46 MB): oneTBB as a wheel, GoogleTest's and meshoptimizer's sources, and two
# meshes for the benchmarks. Carry it along with the repository.
set -euo pipefail
cd "$(dirname "$0")/.."

carry=$PWD/build/gpu-carry
started=$SECONDS

fail() {
  printf 'gpu: %s\n' "$*" >&2
  exit 1
}
step() { printf '== %s (%d s)\n' "$*" $((SECONDS - started)); }
# within SECONDS COMMAND...: at most so long, and never beyond the eight minutes.
within() {
  local left=$((480 - (SECONDS - started))) most=$1
  shift
  timeout $((left < 1 ? 1 : left < most ? left : most)) "$@"
}

[[ $(nvidia-smi -L 2>/dev/null) == *GPU* ]] ||
  fail "there is no NVIDIA GPU here (nvidia-smi lists none); \`make cuda\` builds without one"
command -v nvcc >/dev/null 2>&1 || [[ -x /usr/local/cuda/bin/nvcc ]] ||
  fail "there is no nvcc here: put CUDA's bin folder on the PATH"
command -v nvcc >/dev/null 2>&1 || export PATH=/usr/local/cuda/bin:$PATH
for tool in cmake ninja; do
  command -v "$tool" >/dev/null 2>&1 || fail "there is no $tool here"
done

device=$(nvidia-smi --query-gpu=name --format=csv,noheader -i 0)
arch=$(nvidia-smi --query-gpu=compute_cap --format=csv,noheader -i 0 | tr -d '. ')
arguments=()
if [[ -d $carry ]]; then
  arguments+=("-DTBB_DIR=$carry/tbb/lib/cmake/tbb" "-DUMBEL_MESHOPTIMIZER_DIR=$carry/meshoptimizer"
    "-DUMBEL_GOOGLETEST_DIR=$carry/googletest")
  export LD_LIBRARY_PATH=$carry/tbb/lib:${LD_LIBRARY_PATH:-}
fi

step "building for $device, compute capability $arch"
CUDA_ARCHS=$arch scripts/cuda.sh "${arguments[@]}"

results=bench/results/gpu-$(tr -cs 'A-Za-z0-9\n' '-' <<<"${device,,}").md
keep() {
  [[ -d ${OUT:-} ]] || return 0
  tar czf "$OUT/gpu-results.tar.gz" "${results%.md}"* build/*.log 2>/dev/null || true
}
status=0

step "tests"
tests=passed
within 200 ctest --test-dir build/release -L cuda -j 4 --output-on-failure --no-tests=error \
  >build/gpu-tests.log 2>&1 || tests=failed
tail -n 40 build/gpu-tests.log
[[ $tests == passed ]] || status=1
keep

step "benchmark"
meshes=()
for mesh in "$carry"/dragon_871k.ply "$carry"/conference_331k.ply "${MESH:-}"; do
  [[ -n $mesh && -f $mesh ]] && meshes+=("$mesh")
done
within 110 build/release/bench/cuda_bench --large 16 "${meshes[@]}" | tee "$results" || status=1
keep
within 60 build/release/bench/cuda_query_bench "${meshes[@]}" | tee -a "$results" || status=1
keep
# Then the tests have been skipped.
if grep -q '^# Clusters without' "$results"; then
  echo "gpu: there is a GPU, but CUDA finds no device" >&2
  status=1
fi

# Tables and charts of hierarchies need Python; what was measured is kept without it.
if [[ ${#meshes[@]} -gt 0 ]]; then
  step "hierarchies"
  measured=${results%.md}-bvh
  if within 110 build/release/bench/cuda_bvh_bench --runs 10 --large 16 "${meshes[@]}" \
    >"$measured.json"; then
    PYTHONPATH=python "${PYTHON:-python3}" -m umbel.bench.bvh.cuda "$measured.json" bench/results \
      "$(basename "$measured")" || echo "gpu: no tables of hierarchies: Python cannot make them" >&2
  else
    status=1
  fi
  keep
fi

sanitizer=""
if command -v compute-sanitizer >/dev/null 2>&1; then
  for tool in memcheck racecheck; do
    step "compute-sanitizer $tool"
    if within 100 compute-sanitizer --tool "$tool" --error-exitcode 9 build/release/umbel_cuda_tests \
      --gtest_filter='FrameClustersOnDevice.c_gives*:TeamsOnDevice.*:FrameClustersOnDevice.vertex*:'\
'BuildersSmall*:SelectOnDevice.what_is*:TraceOnDevice.overlaps*:TraceOnDevice.closest*:'\
'TraceOnDevice.masks*:TraceOnDevice.hits_are_those_of_brute*' \
      >"build/sanitizer-$tool.log" 2>&1; then
      sanitizer+="$tool found nothing. "
    else
      tail -n 20 "build/sanitizer-$tool.log"
      sanitizer+="$tool failed. "
      status=1
    fi
    keep
  done
else
  sanitizer="There is no compute-sanitizer here. "
fi

# umbel.cuda needs nothing that is compiled but the library, so it runs from the sources.
arrays="no pytest"
if "${PYTHON:-python3}" -c 'import numpy, pytest' >/dev/null 2>&1; then
  step "arrays of Python's packages"
  PYTHONPATH=python UMBEL_CUDA_LIBRARY=$PWD/build/release/libumbel_cuda_c.so \
    within 120 "${PYTHON:-python3}" -m pytest --noconftest -p no:cacheprovider \
    tests/python/cuda/test_frame_clusters.py tests/python/cuda/test_rays.py 2>&1 |
    tee build/gpu-python.log || status=1
  arrays=$(tail -n 1 build/gpu-python.log | tr -d '=')
fi

printf '\nTests: %s. %sPython: %s.\n' "$tests" "$sanitizer" "$(xargs <<<"$arrays")" >>"$results"
keep
step "done: $results"
exit $status
