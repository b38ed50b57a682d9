#!/usr/bin/env bash
# From a clean checkout on Debian 12 to an edited scene: installs packages, builds, starts the service, and drags the
# ball of the demo scene across the table, over REST. The results are in out/demo. Safe to repeat.
#
#   demo.sh           stops the service when the edit is done
#   demo.sh --keep    leaves it running and prints the address of its page; Ctrl-C ends it
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

keep=false
case "${1:-}" in
  "") ;;
  --keep) keep=true ;;
  *) echo "usage: demo.sh [--keep]" >&2; exit 2 ;;
esac

bash deploy/install-packages.sh
cmake --preset release
cmake --build --preset release --parallel "$(nproc)" --target splatdrag

splatdrag=build/release/splatdrag
out=out/demo
rm -rf "$out"
mkdir -p "$out"
"$splatdrag" demo-scene --out "$out/input"

# The service chooses a free port and says which. On a busy machine it may not have made its file when it is first read.
: >"$out/service.out"
"$splatdrag" serve --port "${SPLATDRAG_PORT:-0}" --data-dir "$out/service" --scene-root "$out/input" \
  >"$out/service.out" 2>"$out/service.log" &
service=$!
trap 'kill "$service" 2>/dev/null || true; wait "$service" 2>/dev/null || true' EXIT
for ((i = 0; i < 100; ++i)); do
  url=$(sed -n 's/^.*listening on \(http:[^ ]*\).*$/\1/p' "$out/service.out")
  [[ -n "$url" ]] && break
  if ! kill -0 "$service" 2>/dev/null; then
    echo "error: the service did not start:" >&2
    cat "$out/service.log" >&2
    exit 1
  fi
  sleep 0.1
done
if [[ -z "$url" ]]; then
  echo "error: the service has not said its address within 10 seconds:" >&2
  cat "$out/service.log" >&2
  exit 1
fi

# call METHOD PATH [curl options]: the answer's body; an error of the service is shown and ends the demo.
call() {
  local method=$1 path=$2 answer
  shift 2
  if ! answer=$(curl --silent --show-error --fail-with-body --request "$method" "$@" "$url$path"); then
    echo "error: $method $path: $(jq -r '.detail // .' <<<"$answer" 2>/dev/null || echo "$answer")" >&2
    exit 1
  fi
  printf '%s' "$answer"
}
call_json() { call "$1" "$2" --header 'Content-Type: application/json' --data "$3"; }

echo "The service is up at $url"
scene=$(call POST '/v1/scenes?name=demo' --header 'Content-Type: application/octet-stream' \
  --data-binary "@$out/input/scene.ply" | jq -r .id)
call_json PUT "/v1/scenes/$scene/dataset" '{"path": "."}' |
  jq -r '"Scene \(.id): \(.gaussians) Gaussians, \(.views) views"'

request=$(jq --arg scene "$scene" '. + {scene: $scene, version: 0, preset: "draft"}' "$out/input/drags/ball.json")
edit=$(call_json POST /v1/edits "$request" | jq -r .id)
while :; do
  status=$(call GET "/v1/edits/$edit")
  jq -r '"Edit \(.id): \(.state), interval \(.interval) of \(.intervals), \((.progress * 100) | floor) %\(if .stage then ": " + .stage else "" end)"' <<<"$status"
  case $(jq -r .state <<<"$status") in
    succeeded) break ;;
    failed | cancelled)
      jq -r '"error: \(.error.detail // .state) \(.error.where // "")"' <<<"$status" >&2
      exit 1
      ;;
  esac
  sleep 0.5
done

version=$(jq -r .result_version <<<"$status")
jq . <<<"$status" >"$out/edit.json"
curl --silent --show-error --fail --output "$out/scene.ply" "$url/v1/scenes/$scene/versions/$version/file?format=ply"
render() { # FILE VERSION VIEW
  curl --silent --show-error --fail --get --output "$out/$1" --data-urlencode "view=$3" --data format=png \
    "$url/v1/scenes/$scene/versions/$2/render"
}
k=0
jq -r '.finished_intervals[-1].renders[:3][].view' <<<"$status" | while read -r view; do
  k=$((k + 1))
  render "before_$k.png" 0 "$view"
  render "after_$k.png" "$version" "$view"
done

echo
echo "The edited scene, for any 3DGS viewer: $PWD/$out/scene.ply"
echo "What it looked like before and after:  $PWD/$out/before_*.png and after_*.png"
echo "What the edit did, as JSON:            $PWD/$out/edit.json"
if $keep; then
  echo "The page, with the scene in it:        $url/"
  echo "The service runs until you press Ctrl-C."
  wait "$service"
fi
