#!/usr/bin/env bash
# Compiles the decoder for the web viewer, viewer/packages/umbel/wasm, to WebAssembly:
# viewer/packages/umbel/src/decode/decoder.wasm, which is committed, so that the viewer builds
# without a compiler. A unit test says when this has to run again. `make wasm` is this script.
set -euo pipefail
cd "$(dirname "$0")/.."
build=build/wasm
zig=ziglang==0.17.1

mkdir -p $build
if [[ $(cat $build/.installed 2>/dev/null) != "$zig" ]]; then
  echo "wasm: installing $zig with pip (100 MB)"
  python3 -m venv $build/venv
  $build/venv/bin/pip install --quiet --disable-pip-version-check "$zig"
  echo "$zig" >$build/.installed
fi

codec=src/asset/codec
sources=(viewer/packages/umbel/wasm/group_decoder.cpp $codec/{connectivity_decoder,normal_prediction}.cpp
  $codec/{octahedral,quantize,shared_vertices,twins,uv_prediction,vertex_decoder,vertex_decoder_3}.cpp
  src/base/error.cpp)
objects=()
rm -f $build/*.d  # of sources that are no longer compiled
for source in "${sources[@]}"; do
  object=$build/$(basename "$source").o
  $build/venv/bin/python -m ziglang c++ --target=wasm32-wasi -std=c++20 -O2 -DNDEBUG \
    -msimd128 -mbulk-memory -fno-rtti -fexceptions -ffp-contract=off -fvisibility=hidden \
    -Iinclude -Isrc -MMD -MF "$object.d" -c "$source" -o "$object"
  objects+=("$object")
done
$build/venv/bin/python -m ziglang c++ --target=wasm32-wasi -mexec-model=reactor \
  -Wl,--no-entry,--strip-all,--gc-sections,-z,stack-size=262144 "${objects[@]}" \
  -o viewer/packages/umbel/src/decode/decoder.wasm
chmod 644 viewer/packages/umbel/src/decode/decoder.wasm
python3 viewer/packages/umbel/wasm/write_sources.py $build
