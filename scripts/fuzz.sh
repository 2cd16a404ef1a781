#!/usr/bin/env bash
# Runs every fuzzer in tests/fuzz for SECONDS_EACH (60) under the address and undefined-behaviour
# sanitizers. What it learns stays in build/fuzz/corpus; an input that fails, in build/fuzz/failures.
set -euo pipefail
cd "$(dirname "$0")/.."

seconds=${SECONDS_EACH:-60}
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
quietly cmake -S . -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=RelWithDebInfo -DCMAKE_CXX_FLAGS_RELWITHDEBINFO="-O1 -g1" \
  -DCMAKE_CXX_COMPILER=clang++ -DUMBEL_BUILD_FUZZ=ON -DUMBEL_BUILD_TESTS=OFF -DUMBEL_INSTALL=OFF \
  -DCMAKE_CXX_FLAGS="-fsanitize=fuzzer-no-link $sanitize -D_GLIBCXX_ASSERTIONS -UNDEBUG"
quietly cmake --build "$build"

passed=0 failed=0
for source in tests/fuzz/*.cpp; do
  name=$(basename "$source" .cpp)
  corpus=$build/corpus/$name
  mkdir -p "$corpus"
  if "$build/$name" -max_total_time="$seconds" -len_control=0 -timeout=25 -rss_limit_mb=4096 -print_final_stats=1 \
    -artifact_prefix="$build/failures/$name-" "$corpus" >"$build/$name.log" 2>&1; then
    runs=$(sed -n 's/^stat::number_of_executed_units: *//p' "$build/$name.log")
    echo "fuzz: $name: $runs inputs in $seconds s, no failure"
    passed=$((passed + 1))
  else
    tail -n 40 "$build/$name.log" >&2
    echo "fuzz: $name: failed; the log is $build/$name.log, the input lies in $build/failures" >&2
    failed=$((failed + 1))
  fi
done
echo "$passed passed, $failed failed"
exit $((failed > 0))
