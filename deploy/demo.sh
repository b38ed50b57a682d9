#!/usr/bin/env bash
# From a clean checkout on Debian 12 to an edited scene: installs packages, builds, makes the demo scene, drags its ball
# across the table. The results are in out/demo. Safe to repeat.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

bash deploy/install-packages.sh
cmake --preset release
cmake --build --preset release --parallel "$(nproc)" --target splatdrag

splatdrag=build/release/splatdrag
"$splatdrag" demo-scene --out out/demo/input
"$splatdrag" edit --scene out/demo/input/scene.ply --dataset out/demo/input \
  --request out/demo/input/drags/ball.json --out out/demo

echo
echo "The edited scene, for any 3DGS viewer: $PWD/out/demo/scene.ply"
echo "What it looked like before and after:  $PWD/out/demo/before_*.png and after_*.png"
echo "What the edit did, as JSON:            $PWD/out/demo/report.json"
