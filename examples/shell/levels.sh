#!/usr/bin/env bash
# Builds an asset from a mesh file, verifies it, and extracts meshes of three sizes.
# usage: levels.sh MESH [FOLDER]
set -euo pipefail

mesh=$1
folder=${2:-.}
name=$(basename "${mesh%.*}")
asset=$folder/$name.umbel

mkdir -p "$folder"
umbel build "$mesh" -o "$asset"
umbel verify "$asset"
for triangles in 10000 1000; do
  umbel extract "$asset" --triangles "$triangles" -o "$folder/${name}_$triangles.glb"
done
umbel extract "$asset" --error inf -o "$folder/${name}_coarsest.glb"
