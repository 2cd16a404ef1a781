#!/usr/bin/env bash
# What `make gpu` and `make gpu-check` do, on a machine with a GPU and without a network.
#
#   scripts/gpu.sh measure    tests, the smallest first; then benchmarks, and a profile
#   scripts/gpu.sh check      the small tests under compute-sanitizer, and arrays of Python's packages
#
# Each is one call of at most UMBEL_GPU_SECONDS (480). Every step has a log, a time limit, and an
# outcome of its own: passed, failed, out of time, or skipped; what one does stops no other. After
# every step bench/results/gpu-DEVICE*.md and the logs are packed into gpu-results.tar.gz in $OUT, if
# there is such a folder.
#
# Programs come from build/gpu-carry/carried.tar.gz, which `make gpu-carry` fills on another machine, so that
# nothing is built here; without it they are built for this GPU, which needs nvcc, CMake and ninja.
set -uo pipefail
cd "$(dirname "$0")/.."

mode=${1:-measure}
carry=${UMBEL_GPU_CARRY:-$PWD/build/gpu-carry}
results_folder=${UMBEL_GPU_RESULTS:-bench/results}
seconds=${UMBEL_GPU_SECONDS:-480}
started=$SECONDS

fail() {
  printf 'gpu: %s\n' "$*" >&2
  exit 1
}
[[ $mode == measure || $mode == check ]] || fail "measure or check, not $mode"
[[ $(nvidia-smi -L 2>/dev/null) == *GPU* ]] ||
  fail "there is no NVIDIA GPU here (nvidia-smi lists none); \`make cuda\` builds without one"
device=$(nvidia-smi --query-gpu=name --format=csv,noheader -i 0)
results=$results_folder/gpu-$(tr -cs 'A-Za-z0-9\n' '-' <<<"${device,,}")
logs=${UMBEL_GPU_LOGS:-build/gpu-logs}
mkdir -p "$logs" "$results_folder"

status=0
outcomes=()

# Everything so far, where it is brought back from.
keep() {
  [[ -d ${OUT:-} ]] || return 0
  tar czf "$OUT/gpu-results.tar.gz" "$results"* "$logs" 2>/dev/null || true
}
note() {
  outcomes+=("| $1 | $2 | $3 |")
  printf '== %s: %s\n' "$1" "$2"
}
# step NAME SECONDS COMMAND...: what it prints goes to the log.
step() {
  local name=$1 most=$2 left=$((seconds - (SECONDS - started))) begun=$SECONDS code=0
  shift 2
  if ((left < 5)); then
    note "$name" "skipped: no time is left" 0
    status=1
    return 1
  fi
  printf '== %s (at %d s)\n' "$name" $((SECONDS - started))
  timeout -k 5 $((left < most ? left : most)) "$@" >"$logs/$name.log" 2>&1 || code=$?
  case $code in
    0) note "$name" passed $((SECONDS - begun)) ;;
    124 | 137) note "$name" "out of time" $((SECONDS - begun)) ;;
    *) note "$name" "failed ($code)" $((SECONDS - begun)) ;;
  esac
  if ((code != 0)); then
    tail -n 20 "$logs/$name.log"
    status=1
  fi
  keep
  return "$code"
}
skip() { note "$1" "skipped: $2" 0; }

# Programs that were carried here, or else are built here.
if [[ -f $carry/carried.tar.gz ]] && ! tar xzf "$carry/carried.tar.gz" -C "$carry"; then
  fail "$carry/carried.tar.gz is damaged; run \`make gpu-carry\` again"
fi
bin=$carry/bin
tests=$bin/umbel_cuda_tests
library=$bin/libumbel_cuda_c.so
[[ -d $carry/tbb/lib ]] && export LD_LIBRARY_PATH=$carry/tbb/lib:${LD_LIBRARY_PATH:-}
if [[ ! -x $tests ]]; then
  command -v nvcc >/dev/null 2>&1 || export PATH=/usr/local/cuda/bin:$PATH
  for tool in nvcc cmake ninja; do
    command -v "$tool" >/dev/null 2>&1 ||
      fail "there is neither $bin, which \`make gpu-carry\` fills, nor $tool"
  done
  arguments=()
  if [[ -d $carry ]]; then
    arguments+=("-DTBB_DIR=$carry/tbb/lib/cmake/tbb" "-DUMBEL_MESHOPTIMIZER_DIR=$carry/meshoptimizer"
      "-DUMBEL_GOOGLETEST_DIR=$carry/googletest")
  fi
  arch=$(nvidia-smi --query-gpu=compute_cap --format=csv,noheader -i 0 | tr -d '. ')
  CUDA_ARCHS=$arch step build 300 scripts/cuda.sh "${arguments[@]}" || exit 1
  bin=build/release/bench
  tests=build/release/umbel_cuda_tests
  library=build/release/libumbel_cuda_c.so
fi

meshes=()
for mesh in "$carry"/dragon_871k.ply "$carry"/conference_331k.ply "${MESH:-}"; do
  [[ -n $mesh && -f $mesh ]] && meshes+=("$mesh")
done
small='ExecOnDevice.*:TeamsOnDevice.*:BuildersSmallOnDevice.*:*OnDevice.c_gives*:OnDevice.*'

# Tables and charts of hierarchies need Python; what was measured is kept without it.
tables() {
  PYTHONPATH=python "${PYTHON:-python3}" -m umbel.bench.bvh.cuda "$results-bvh.json" \
    "$results_folder" "$(basename "$results")-bvh"
}

measure() {
  step smallest-tests 60 "$tests" --gtest_filter="$small" --gtest_brief=1
  step tests 180 "$tests" --gtest_filter="-$small" --gtest_brief=1
  step clusters 60 "$bin/cuda_bench" --large 16 "${meshes[@]}"
  step rays-and-selection 60 "$bin/cuda_query_bench" "${meshes[@]}"
  step frame 30 "$bin/cuda_frame_example" 200
  if ((${#meshes[@]} > 0)); then
    # shellcheck disable=SC2016
    step hierarchies 120 bash -c '"$0" --runs 10 --large 16 "${@:2}" >"$1"' \
      "$bin/cuda_bvh_bench" "$results-bvh.json" "${meshes[@]}" && step tables 20 "$tables_in_shell"
  else
    skip hierarchies "there is no mesh in $carry"
  fi
  if command -v nsys >/dev/null 2>&1 && ((${#meshes[@]} > 0)); then
    step profile 60 nsys profile --stats=true --force-overwrite=true -o "$logs/profile" \
      "$bin/cuda_bvh_bench" --runs 2 "${meshes[0]}"
  else
    skip profile "there is no nsys here"
  fi
}

check() {
  local tool
  for tool in memcheck racecheck synccheck; do
    if command -v compute-sanitizer >/dev/null 2>&1; then
      step "$tool" 130 compute-sanitizer --tool "$tool" --error-exitcode 9 "$tests" \
        --gtest_brief=1 --gtest_filter='FrameClustersOnDevice.c_gives*:TeamsOnDevice.*:'\
'FrameClustersOnDevice.vertex*:BuildersSmall*:SelectOnDevice.what_is*:TraceOnDevice.overlaps*:'\
'TraceOnDevice.closest*:TraceOnDevice.masks*:TraceOnDevice.hits_are_those_of_brute*:FrameGraph*'
    else
      skip "$tool" "there is no compute-sanitizer here"
    fi
  done
  # umbel.cuda needs nothing that is compiled but the library, so it runs from the sources.
  if "${PYTHON:-python3}" -c 'import numpy, pytest' >/dev/null 2>&1; then
    PYTHONPATH=python UMBEL_CUDA_LIBRARY=$library step python 120 "${PYTHON:-python3}" -m pytest \
      --noconftest -p no:cacheprovider tests/python/cuda/test_frame_clusters.py \
      tests/python/cuda/test_rays.py
  else
    skip python "there is no pytest here"
  fi
}

# `timeout` starts programs, not functions.
export -f tables
export results results_folder
tables_in_shell=$logs/tables.sh
printf '#!/usr/bin/env bash\ntables\n' >"$tables_in_shell"
chmod +x "$tables_in_shell"

if [[ $mode == measure ]]; then measure; else check; fi

page=$results.md
if [[ $mode == check ]]; then page=$results-checks.md; fi
{
  printf '# %s\n\n' "$device"
  printf '`make gpu%s` of %s, driver %s.\n\n' "$([[ $mode == check ]] && echo -check)" \
    "$(git rev-parse --short HEAD 2>/dev/null || echo 'an unknown revision')" \
    "$(nvidia-smi --query-gpu=driver_version --format=csv,noheader -i 0)"
  printf '| step | outcome | seconds |\n|---|---|--:|\n'
  printf '%s\n' "${outcomes[@]}"
  for figures in clusters rays-and-selection frame; do
    [[ $mode == measure && -s $logs/$figures.log ]] && printf '\n' && cat "$logs/$figures.log"
  done
} >"$page"
keep
printf '== done: %s\n' "$page"
exit "$status"
