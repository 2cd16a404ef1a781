#!/usr/bin/env bash
# A mesh file to an asset, proved, and then to ordinary meshes of three sizes.
# usage: levels.sh MESH [FOLDER]
set -euo pipefail

mesh=$1
folder=${2:-.}
name=$(basename "${mesh%.*}")
asset=$folder/$name.umbel

umbel build "$mesh" -o "$asset"
umbel verify "$asset"
for triangles in 10000 1000; do
  umbel extract "$asset" --triangles "$triangles" -o "$folder/${name}_$triangles.glb"
done
umbel extract "$asset" --error inf -o "$folder/${name}_coarsest.glb"
