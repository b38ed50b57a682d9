#!/usr/bin/env bash
# Kills the service and damages what it has stored, more often than continuous integration has time for. Fails where
# something is lost, or served that is not what it was. Needs what tests/run.sh has installed; at 200 times it takes some
# ten minutes.
#
#   endure.sh [times] [seed]     200 of each, unless told otherwise, by chance in the order of the seed (1)
#
# SPLATDRAG_PROGRAM names another program than that of the preset `release`, which is built else.
set -euo pipefail
if [[ -n "${SPLATDRAG_PROGRAM:-}" ]]; then
  SPLATDRAG_PROGRAM=$(realpath "$SPLATDRAG_PROGRAM")
  export SPLATDRAG_PROGRAM
fi
cd "$(dirname "${BASH_SOURCE[0]}")/.."

times=${1:-200}
if [[ -z "${SPLATDRAG_PROGRAM:-}" ]]; then
  cmake --preset release
  cmake --build --preset release --parallel "$(nproc)" --target splatdrag
fi
cd tests/service
export SPLATDRAG_TEST_KILLS=$times SPLATDRAG_TEST_DAMAGES=$times SPLATDRAG_TEST_SEED=${2:-1}
# One after the other: each of them measures out time itself.
for suite in lifecycle damages; do
  node --test "$suite.test.mjs"
done
