#!/usr/bin/env bash
# Checks the sources without running them: their layout by clang-format, what .clang-tidy asks for, and of the contract
# what .yamllint asks for. Prints the place of each finding, and on the last line how many there are; fails if there is
# one. Installs what is missing and asks nothing.
#
#   lint.sh             every tracked source; of the tests only the layout, for they would double the time
#   lint.sh FILE ...    these files only
#   lint.sh --layout    clang-format and yamllint alone, over every tracked source: seconds in place of ten minutes
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
root=$(pwd -P)  # as clang-tidy writes it, where a checkout is reached by a link

if [[ "${1:-}" == --layout ]]; then
  mapfile -t sources < <(git ls-files '*.cc' '*.h' '*.inc')
  units=()
elif (($# > 0)); then
  sources=("$@")
  units=("$@")
else
  mapfile -t sources < <(git ls-files '*.cc' '*.h' '*.inc')
  mapfile -t units < <(git ls-files 'engine/*.cc' 'proto/*.cc' 'server/*.cc' 'bench/*.cc')
fi
mapfile -t units < <(printf '%s\n' "${units[@]}" | grep '\.cc$' || true)
# Clang 19 does not read torch 1.13 as C++20 (vectors of what is only declared, which GCC lets pass), and then says nothing of
# the rest either: what includes it has the compiler's warnings and its layout alone.
named=${#units[@]}
if ((named > 0)); then
  mapfile -t units < <(grep -LE '^#include <(ATen|torch)/' "${units[@]}" || true)
fi

bash deploy/install-packages.sh lint
if ((${#units[@]} > 0)); then
  cmake --preset release --log-level=WARNING >/dev/null
fi

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
mkdir "$work/reports"

# One line for each place that clang-format would change.
clang-format-14 --dry-run -Werror "${sources[@]}" 2>&1 | grep ': error: ' >"$work/format" || true

# Highway compiles a file once for each instruction set; to read it once is enough. Clang does not know all of GCC's
# warnings, and -Werror would stop at the first of its own: .clang-tidy decides what is an error.
check_unit() {
  local report="$work/reports/${1//\//_}"
  clang-tidy-19 --quiet -p build/release --extra-arg=-DHWY_COMPILE_ONLY_STATIC \
    --extra-arg=-Wno-unknown-warning-option --extra-arg=-Wno-ignored-gch --extra-arg=-Wno-error "$1" >"$report" 2>&1 && return
  # A failure always has a line that counts, even where clang-tidy itself broke, or stopped in a header of others.
  if ! grep -F "$root/" "$report" | grep -qE ': (warning|error): '; then
    echo "$root/$1:1:1: error: clang-tidy failed: $(grep -m 1 'error:' "$report" || tail -n 1 "$report")" >>"$report"
  fi
}
export -f check_unit
export work root
if ((${#units[@]} > 0)); then
  printf '%s\0' "${units[@]}" | xargs -0 -n 1 -P "$(nproc)" bash -c 'check_unit "$1"' check_unit
  # A header's findings come with every file that includes it; those of other projects' headers are not ours.
  cat "$work/reports/"* | grep -F "$root/" | grep -E ': (warning|error): ' | sed -e "s|^$root/||" -e 's/,-warnings-as-errors\]$/]/' |
    sort -u -t : -k 1,1 -k 2,2n -k 3,3n -k 4 >"$work/tidy" || true
fi
touch "$work/tidy"

mapfile -t contracts < <(git ls-files '*.yaml' '*.yml')
yamllint --strict --format parsable --config-file .yamllint "${contracts[@]}" >"$work/yaml" || true

cat "$work/format" "$work/yaml" "$work/tidy"
layout=$(wc -l <"$work/format")
yaml=$(wc -l <"$work/yaml")
findings=$(wc -l <"$work/tidy")
echo "lint: clang-format ${#sources[@]} files, $layout findings; yamllint ${#contracts[@]} files, $yaml findings; clang-tidy ${#units[@]} files, $findings findings ($((named - ${#units[@]})) of libtorch left out)"
((layout + yaml + findings == 0))
