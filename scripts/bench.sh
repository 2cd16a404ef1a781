#!/usr/bin/env bash
# Runs the programs of bench/ one after the other on the meshes (binary PLY files) named as
# arguments, or on the Stanford dragon.
set -euo pipefail
cd "$(dirname "$0")/.."

meshes=("$@")
if ((!${#meshes[@]})); then
  meshes=(build/demo/dragon_binary.ply)
  [[ -f ${meshes[0]} ]] || .venv/bin/python - "${meshes[0]}" <<'PY'
import sys

import trimesh

sys.path.insert(0, "scripts")
from demo import OUTPUT, dragon

OUTPUT.mkdir(parents=True, exist_ok=True)
trimesh.load_mesh(dragon(), process=False).export(sys.argv[1], encoding="binary_little_endian")
PY
fi

found=0
for program in build/release/bench/*; do
  [[ -f $program && -x $program ]] || continue
  found=1
  echo "== ${program##*/}"
  "$program" "${meshes[@]}"
done
if ((!found)); then
  echo "bench: there is no program in bench/" >&2
  exit 1
fi
