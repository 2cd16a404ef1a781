#!/usr/bin/env bash
# What `make gpu`, `make gpu-check` and `make gpu-paths` do, on a machine with a GPU and without a
# network.
#
#   scripts/gpu.sh measure            tests, the smallest first; then benchmarks, and a profile
#   scripts/gpu.sh check              the small tests under compute-sanitizer, and arrays of Python's
#                                     packages
#   scripts/gpu.sh paths [SCENE...]   pictures by path tracing through the trees of all builders
#
# Each is one call of at most UMBEL_GPU_SECONDS (480; of `paths` 570). Every step has a log, a time
# limit, and an outcome of its own: passed, failed, out of time, or skipped; what one does stops no
# other. After every step bench/results/gpu-DEVICE* and the logs are packed into gpu-results.tar.gz in
# $OUT, if there is such a folder.
#
# `paths` has a step for each scene, leaves out those whose results are in
# bench/results/gpu-DEVICE-paths, and starts none without time: call it again for the rest, with what
# came back unpacked where it was.
#
# Programs come from build/gpu-carry/carried.tar.gz, which `make gpu-carry` fills on another machine, so that
# nothing is built here; without it they are built for this GPU, which needs nvcc, CMake and ninja.
set -uo pipefail
cd "$(dirname "$0")/.."

mode=${1:-measure}
carry=${UMBEL_GPU_CARRY:-$PWD/build/gpu-carry}
results_folder=${UMBEL_GPU_RESULTS:-bench/results}
started=$SECONDS

fail() {
  printf 'gpu: %s\n' "$*" >&2
  exit 1
}
[[ $mode == measure || $mode == check || $mode == paths ]] ||
  fail "measure, check or paths, not $mode"
seconds=${UMBEL_GPU_SECONDS:-$([[ $mode == paths ]] && echo 570 || echo 480)}
[[ $(nvidia-smi -L 2>/dev/null) == *GPU* ]] ||
  fail "there is no NVIDIA GPU here (nvidia-smi lists none); \`make cuda\` builds without one"
device=$(nvidia-smi --query-gpu=name --format=csv,noheader -i 0)
results=$results_folder/gpu-$(tr -cs 'A-Za-z0-9\n' '-' <<<"${device,,}")
logs=${UMBEL_GPU_LOGS:-build/gpu-logs}
mkdir -p "$logs" "$results_folder"

status=0
no_device=199  # instead of the status of a program that does without
outcomes=()

# Everything so far, where it is brought back from.
keep() {
  [[ -d ${OUT:-} ]] || return 0
  # What was packed last stays whole if the machine is taken away now.
  tar czf "$OUT/gpu-results.part" --exclude='*.ply' "$results"* "$logs" 2>/dev/null || true
  mv -f "$OUT/gpu-results.part" "$OUT/gpu-results.tar.gz"
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
  # A driver that is too old for the programs shows them none: tests are skipped, and benchmarks have
  # the processor alone.
  if ((code == 0)) &&
    grep -qE 'there is no CUDA device here|without a CUDA device' "$logs/$name.log"; then
    code=$no_device
  fi
  case $code in
    0) note "$name" passed $((SECONDS - begun)) ;;
    "$no_device") note "$name" "failed: CUDA finds no device that it can use" $((SECONDS - begun)) ;;
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

python=${PYTHON:-python3}
scenes=$carry/scenes
has_scenes() { [[ -f $scenes/scenes.json ]] && "$python" -c 'import numpy' >/dev/null 2>&1; }
device_paths() { PYTHONPATH=python "$python" -B bench/device_paths.py "$@"; }

meshes=()
if [[ $mode == measure ]]; then
  for name in dragon_871k conference_331k; do
    mesh=$logs/$name.ply
    has_scenes && device_paths unpack "$scenes" "$name" "$mesh" && meshes+=("$mesh")
  done
  [[ -n ${MESH:-} && -f $MESH ]] && meshes+=("$MESH")
fi
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
    skip hierarchies "there are no scenes in $carry, or no NumPy"
  fi
  profile
}

# What the kernels of a build take. Clocks are left as they are.
profile() {
  if ! command -v ncu >/dev/null 2>&1 || ((${#meshes[@]} == 0)); then
    skip profile "there is no ncu here, or no scene"
    return
  fi
  local -a ncu=(ncu --csv --page details --print-units base --clock-control none
    --section SpeedOfLight --section Occupancy --section WarpStateStats)
  local builder pages=()
  for builder in lbvh hploc; do
    step "profile-$builder" 60 "${ncu[@]}" --launch-count 26 --log-file "$logs/profile-$builder.csv" \
      "$bin/cuda_bvh_bench" --runs 1 --builder "$builder" "${meshes[0]}" &&
      pages+=("$logs/profile-$builder.csv")
  done
  step profile-clusters 60 "${ncu[@]}" --launch-count 16 --log-file "$logs/profile-clusters.csv" \
    "$bin/cuda_bench" --runs 1 "${meshes[0]}" && pages+=("$logs/profile-clusters.csv")
  if ((${#pages[@]} > 0)); then
    step profile-page 20 env PYTHONPATH=python "$python" -B bench/device_profile.py \
      "$results-profile.md" "${pages[@]}"
  fi
}

check() {
  local tool
  for tool in memcheck racecheck synccheck; do
    if command -v compute-sanitizer >/dev/null 2>&1; then
      step "$tool" 130 compute-sanitizer --tool "$tool" --error-exitcode 9 "$tests" \
        --gtest_filter='FrameClustersOnDevice.c_gives*:TeamsOnDevice.*:'\
'FrameClustersOnDevice.vertex*:BuildersSmall*:SelectOnDevice.what_is*:TraceOnDevice.overlaps*:'\
'TraceOnDevice.closest*:TraceOnDevice.masks*:TraceOnDevice.hits_are_those_of_brute*:FrameGraph*'
    else
      skip "$tool" "there is no compute-sanitizer here"
    fi
  done
  # umbel.cuda needs nothing that is compiled but the library, so it runs from the sources.
  if "$python" -c 'import numpy, pytest' >/dev/null 2>&1; then
    PYTHONPATH=python UMBEL_CUDA_LIBRARY=$library step python 120 "$python" -m pytest \
      --noconftest -p no:cacheprovider tests/python/cuda/test_frame_clusters.py \
      tests/python/cuda/test_rays.py
  else
    skip python "there is no pytest here"
  fi
}

# A scene gets all the time that is left, and is begun with no less than UMBEL_GPU_LEAST; it begins
# no pass after three quarters of that. UMBEL_GPU_PATHS are more arguments of the program.
paths() {
  local results_of_scenes=$results-paths least=${UMBEL_GPU_LEAST:-90} left=0 name
  local -a names=("$@") options=()
  read -ra options <<<"${UMBEL_GPU_PATHS:-}"
  if ! has_scenes; then
    skip paths "there are no scenes in $carry, or no NumPy"
    status=1
    return
  fi
  mkdir -p "$results_of_scenes"
  if ((${#names[@]} == 0)); then
    mapfile -t names < <(device_paths missing "$scenes" "$results_of_scenes")
  fi
  for name in "${names[@]}"; do
    left=$((seconds - (SECONDS - started)))
    if ((left < least)); then
      skip "paths-$name" "call again"
      status=1
      continue
    fi
    PYTHONPATH=python step "paths-$name" "$left" "$python" -B bench/device_paths.py run "$scenes" \
      "$name" "$results_of_scenes/$name.json" "$bin/cuda_paths_bench" --seconds $((left * 3 / 4)) \
      "${options[@]}"
  done
  device_paths report "$results_of_scenes" "$results-paths.md" || status=1
}

# `timeout` starts programs, not functions.
export -f tables
export results results_folder
tables_in_shell=$logs/tables.sh
printf '#!/usr/bin/env bash\ntables\n' >"$tables_in_shell"
chmod +x "$tables_in_shell"

case $mode in
  measure) page=$results.md ;;
  check) page=$results-checks.md ;;
  paths) page=$results-paths-steps.md ;;
esac
"$mode" "${@:2}"
{
  printf '# %s\n\n' "$device"
  printf '`make gpu%s` of %s, driver %s.\n\n' "$([[ $mode != measure ]] && echo "-$mode")" \
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
