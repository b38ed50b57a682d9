#!/usr/bin/env bash
# Builds tests with a sanitizer and runs them; fails at the first finding. Needs what tests/run.sh has installed.
#
#   sanitized.sh asan   the unit tests, under AddressSanitizer and UBSan
#   sanitized.sh tsan   those of queue and service, where threads meet, under ThreadSanitizer
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

case "${1:-}" in
  asan) export ASAN_OPTIONS=detect_stack_use_after_return=1:strict_string_checks=1:check_initialization_order=1
        export UBSAN_OPTIONS=print_stacktrace=1:halt_on_error=1 ;;
  tsan) ;;  # its options are those of the preset
  *) echo "usage: sanitized.sh asan|tsan" >&2; exit 2 ;;
esac
cmake --preset "$1" -DSPLATDRAG_BENCHMARKS=OFF
cmake --build --preset "$1" --parallel "$(nproc)"
exec ctest --preset "$1" --parallel 2 --no-tests=error --stop-on-failure
