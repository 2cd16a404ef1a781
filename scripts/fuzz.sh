#!/usr/bin/env bash
# Runs every fuzzer in tests/fuzz for SECONDS_EACH (60) under the address and undefined-behaviour
# sanitizers, JOBS at a time, or those that FUZZERS names. They begin with what was ever found
# (tests/fuzz/corpus); what they learn stays in build/fuzz/corpus, and an input that fails, made
# smaller, in build/fuzz/failures. FUZZ_LEVEL=-O0 builds in a third of the time, and SEED=1 tries the
# same inputs in the same order each time, for CI.
set -euo pipefail
cd "$(dirname "$0")/.."

seconds=${SECONDS_EACH:-60}
jobs=${JOBS:-$(nproc 2>/dev/null || echo 2)}
level=${FUZZ_LEVEL:--O1}
build=build/fuzz
log=$build/log
mkdir -p "$build/failures"

quietly() {
  if ! "$@" >"$log" 2>&1; then
    tail -n 40 "$log" >&2
    echo "fuzz: '$1' failed; the whole log is $log" >&2
    exit 1
  fi
}

# True if clang++ is there with libFuzzer and the sanitizers, which Debian packages apart.
can_fuzz() {
  command -v clang++ >/dev/null 2>&1 &&
    printf 'extern "C" int LLVMFuzzerTestOneInput(const unsigned char*, unsigned long) { return 0; }' |
    clang++ -x c++ -fsanitize=fuzzer,address,undefined - -o "$build/probe" >/dev/null 2>&1
}

if ! can_fuzz; then
  if [[ $(id -u) != 0 ]] || ! command -v apt-get >/dev/null 2>&1; then
    echo "fuzz: install clang with its sanitizers (Debian: clang libclang-rt-14-dev) and try again" >&2
    exit 1
  fi
  echo "fuzz: installing clang with apt-get"
  export DEBIAN_FRONTEND=noninteractive
  quietly apt-get update
  quietly apt-get install -y --no-install-recommends clang libclang-rt-14-dev
fi

sanitize="-fsanitize=address,undefined,float-cast-overflow -fno-sanitize-recover=all"
quietly cmake -S . -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=RelWithDebInfo -DCMAKE_CXX_FLAGS_RELWITHDEBINFO="$level -g1" \
  -DCMAKE_CXX_COMPILER=clang++ -DUMBEL_BUILD_FUZZ=ON -DUMBEL_BUILD_TESTS=OFF -DUMBEL_INSTALL=OFF \
  -DCMAKE_CXX_FLAGS="-fsanitize=fuzzer-no-link $sanitize -D_GLIBCXX_ASSERTIONS -UNDEBUG"
quietly cmake --build "$build"

# Runs one fuzzer; the last line that it prints says how it went.
fuzz() {
  local name=$1 corpus=$build/corpus/$1 kept=tests/fuzz/corpus/$1 runs
  local -a limits=(-len_control=0 -timeout=120 -rss_limit_mb=4096)
  mkdir -p "$corpus" "$build/failures/$name"
  rm -f "$build/failures/$name"/*
  local -a inputs=("$corpus")
  if [[ -d $kept ]]; then inputs+=("$kept"); fi
  if "$build/$name" "${limits[@]}" -max_total_time="$seconds" ${SEED:+-seed="$SEED"} -print_final_stats=1 \
    -artifact_prefix="$build/failures/$name/" "${inputs[@]}" >"$build/$name.log" 2>&1; then
    runs=$(sed -n 's/^stat::number_of_executed_units: *//p' "$build/$name.log")
    echo "fuzz: $name: $runs inputs in $seconds s, no failure"
    return
  fi
  grep -E 'runtime error|ERROR: |fuzz: |SUMMARY' "$build/$name.log" | head -n 5 | sed "s/^/fuzz: $name: /"
  for input in "$build/failures/$name"/crash-*; do
    if [[ -e $input ]]; then
      "$build/$name" "${limits[@]}" -minimize_crash=1 -max_total_time=20 \
        -exact_artifact_path="$build/failures/$name/smallest" "$input" >/dev/null 2>&1 || true
    fi
  done
  echo "fuzz: $name: failed; the log is $build/$name.log, the input lies in $build/failures/$name:" \
    "once it is mended, keep it in $kept"
  return 1
}
export -f fuzz
export build seconds

names=${FUZZERS:-$(cd tests/fuzz && printf '%s\n' *.cpp | sed 's/\.cpp$//')}
status=0
tr ' ' '\n' <<<"$names" | xargs -P "$jobs" -I {} bash -euo pipefail -c 'fuzz {}' || status=1
if [[ -z ${FUZZERS:-} ]]; then
  .venv/bin/python scripts/fuzz_readers.py --seconds "$seconds" --build "$build" --jobs "$jobs" || status=1
fi
if ((status == 0)); then echo "fuzz: no failure"; else echo "fuzz: some failed" >&2; fi
exit $status
