#!/usr/bin/env bash
# Installs what is missing, builds, and runs every test. Ends with ctest's summary and its exit status.
# Tests that need the shared data (see tests/support/data.h) are skipped where it is absent.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

bash deploy/install-packages.sh tests
npm ci --prefix tests/service --no-audit --no-fund --loglevel=error
cmake --preset release
cmake --build --preset release --parallel "$(nproc)"
exec ctest --preset release --parallel 2 --no-tests=error
