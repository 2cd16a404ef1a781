#!/usr/bin/env bash
# What `make simt` does: runs the tests of umbel::cuda on an emulated device (tests/simt) over seeds,
# and over fewer with ThreadSanitizer. No GPU and no CUDA is needed.
#
#   SEEDS=50 SANITIZED_SEEDS=2 LARGE_SEEDS=1 FIRST_SEED=1 scripts/simt.sh
set -euo pipefail
cd "$(dirname "$0")/.."

seeds=${SEEDS:-50}
sanitized=${SANITIZED_SEEDS:-$((seeds / 25 > 0 ? seeds / 25 : 1))}
large=${LARGE_SEEDS:-$((seeds / 50 > 0 ? seeds / 50 : 1))}

build=build/release
if [[ ! -f $build/CMakeCache.txt ]]; then cmake --preset release >build/configure.log; fi
cmake --build "$build" --target umbel_simt_tests umbel_simt_exec_tests umbel_simt_tests_tsan umbel_simt_exec_tests_tsan

# Each into its log; those that fail show theirs.
logs=$build/simt
mkdir -p "$logs"
failed=0
run() {
  local name=$1 program=$2 count=$3 filter=$4
  if ! SEEDS=$count "$build/$program" --gtest_brief=1 --gtest_filter="$filter" >"$logs/$name.log" 2>&1; then
    tail -n 60 "$logs/$name.log" >&2
    echo "simt: $name failed; the log is $logs/$name.log" >&2
    return 1
  fi
  echo "simt: $name passed over $count seeds"
}
all() {
  run "tests$1" "umbel_simt_tests$1" "$2" "$3" || return 1
  run "executor$1" "umbel_simt_exec_tests$1" "$2" '*' || return 1
}
# ThreadSanitizer takes twenty times as long, so small meshes must do.
all _tsan "$sanitized" '-Larger*:AnySize*' &
first=$!
all "" "$seeds" '-Larger*' || failed=1
run larger umbel_simt_tests "$large" 'Larger*' || failed=1
wait "$first" || failed=1
exit "$failed"
