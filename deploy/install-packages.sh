#!/usr/bin/env bash
# Installs what splatdrag needs on Debian 12. Asks nothing, and does nothing where all is installed.
#
#   install-packages.sh          to build and run it
#   install-packages.sh tests    to run all tests, too: a browser, Node.js to drive it, a PostgreSQL server, and what
#                                diffusion models need
#   install-packages.sh lint     to check the sources, too: clang-format, clang-tidy, and yamllint for the contract
#   install-packages.sh fuzz     to fuzz the readers, too: clang and its runtime
set -euo pipefail

packages=(
  g++ cmake ninja-build pkg-config ccache git ca-certificates
  libopenimageio-dev openimageio-tools libopenexr-dev  # pictures
  libglm-dev libexpected-dev libtbb-dev libhwy-dev     # mathematics, results, threads, SIMD
  libflann-dev liblz4-dev                              # nearest neighbours
  libeigen3-dev                                        # sparse equations
  nlohmann-json3-dev libtomlplusplus-dev libcli11-dev
  zlib1g-dev libzstd-dev libwebp-dev                   # compressed scenes
  libsqlite3-dev libpq-dev                             # job records, in a file or in a database
  libzip-dev libxxhash-dev                             # zip files, checksums of stored files
  libcpp-httplib-dev libspdlog-dev prometheus-cpp-dev  # the service: HTTP, logs, metrics
  libgtest-dev libbenchmark-dev                        # tests and benchmarks
  curl jq                                              # the demo talks to the service
)
if [[ "${1:-}" == tests ]]; then
  packages+=(chromium webp)  # webp: the README's animation
  packages+=(postgresql-15)  # the tests start servers of their own with it, and never reach the one that it may start
  packages+=(libtorch-dev libopenblas0-pthread libutf8proc-dev)  # diffusion models; without OpenBLAS, training takes five times as long
  # A newer Node.js from elsewhere will do.
  if ! command -v node >/dev/null || ! command -v npm >/dev/null; then
    packages+=(nodejs npm)
  fi
elif [[ "${1:-}" == lint ]]; then
  # Named by version: what is clean for one is not for the next. clang-tidy before 17 cannot read this C++20.
  packages+=(clang-format-14 clang-tidy-19 yamllint)
elif [[ "${1:-}" == fuzz ]]; then
  packages+=(clang-19 libclang-rt-19-dev)  # before 16, clang cannot read GCC 12's ranges
elif (($# > 0)); then
  echo "usage: install-packages.sh [tests|lint|fuzz]" >&2
  exit 2
fi

installed() { [[ "$(dpkg-query --show --showformat='${db:Status-Status}' "$1" 2>/dev/null)" == installed ]]; }

missing=()
for package in "${packages[@]}"; do
  installed "$package" || missing+=("$package")
done
if ((${#missing[@]} == 0)); then
  exit 0
fi

as_root=()
if ((EUID != 0)); then
  if ! sudo -n true 2>/dev/null; then
    echo "error: these packages are missing and only root can install them: ${missing[*]}" >&2
    echo "run: sudo apt-get install --no-install-recommends ${missing[*]}" >&2
    exit 1
  fi
  as_root=(sudo -n)
fi
echo "Installing ${missing[*]}"
apt=("${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -q)
"${apt[@]}" update
"${apt[@]}" install -y --no-install-recommends "${missing[@]}"
