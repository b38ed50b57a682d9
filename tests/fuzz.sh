#!/usr/bin/env bash
# Runs the fuzz targets (tests/fuzz), each for some seconds, and fails at the first finding. Needs clang-19 and its
# runtime, which are installed where they are missing.
#
#   fuzz.sh [seconds] [target ...]     20 seconds each of all targets, unless told otherwise
#
# What has been found interesting is kept in build/fuzz/corpus and begun with the next time. A finding's input lies in
# build/fuzz/findings; it belongs into a test of the reader's room before it is mended.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

bash deploy/install-packages.sh fuzz
seconds=${1:-20}
shift || true
cmake --preset fuzz
if (($# > 0)); then
  cmake --build --preset fuzz --parallel "$(nproc)" --target "${@/#/fuzz_}"
else
  cmake --build --preset fuzz --parallel "$(nproc)"
fi
export ASAN_OPTIONS=detect_leaks=1:allocator_may_return_null=1 UBSAN_OPTIONS=print_stacktrace=1:halt_on_error=1
mkdir -p build/fuzz/findings
for program in build/fuzz/fuzz/fuzz_*; do
  target=${program##*/fuzz_}
  if (($# > 0)) && [[ " $* " != *" $target "* ]]; then continue; fi
  corpus=build/fuzz/corpus/$target
  mkdir -p "$corpus"
  SPLATDRAG_SEEDS=$corpus "$program"
  # An input may take 10 s and 2 GB at most: a reader's limits are far below both. 64 KB hold more than any seed.
  "$program" -max_total_time="$seconds" -timeout=10 -rss_limit_mb=2048 -max_len=65536 -print_final_stats=0 -verbosity=0 \
    -artifact_prefix="build/fuzz/findings/$target-" "$corpus"
  echo "fuzz: $target, $seconds s, $(find "$corpus" -type f | wc -l) inputs, no finding"
done
