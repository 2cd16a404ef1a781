#!/usr/bin/env bash
# What `make gpu-carry` does: puts into build/gpu-carry what `make gpu` needs on a machine without a
# network: the programs, built for compute capability 9.0 (CUDA_ARCHS for others), oneTBB, the scenes
# (and MESH=...), and the sources to build the programs again. Needs a network, or Debian's libgtest-dev and a build
# of this repository.
set -euo pipefail
cd "$(dirname "$0")/.."

carry=build/gpu-carry
fail() {
  printf 'gpu-carry: %s\n' "$*" >&2
  exit 1
}
rm -rf "$carry"
mkdir -p "$carry"

echo "gpu-carry: oneTBB"
"${PYTHON:-python3}" -m venv "$carry/venv"
"$carry/venv/bin/python" -m pip install --quiet --disable-pip-version-check --no-compile \
  "$(grep -oE '^tbb-devel==[0-9.]+' scripts/requirements.txt)" || fail "pip could not install oneTBB"
mkdir -p "$carry/tbb"
cp -r "$carry"/venv/include "$carry/tbb/"
mkdir -p "$carry/tbb/lib"
cp -r "$carry"/venv/lib/cmake "$carry/tbb/lib/"
cp -P "$carry"/venv/lib/libtbb.so* "$carry"/venv/lib/libtbbmalloc*.so* "$carry/tbb/lib/"
rm -rf "$carry/venv"

echo "gpu-carry: meshoptimizer"
sources=$(sed -nE 's|.*"file": "(.*)/src/vertexcodec\.cpp".*|\1|p' build/release/compile_commands.json |
  head -n 1)
[[ -n $sources && -d $sources/src ]] ||
  fail "run \`make build\` first: it fetches meshoptimizer's sources"
mkdir -p "$carry/meshoptimizer"
cp -r "$sources/src" "$carry/meshoptimizer/"

echo "gpu-carry: GoogleTest"
[[ -d /usr/src/googletest/googletest ]] || fail "there is no /usr/src/googletest: install googletest"
mkdir -p "$carry/googletest"
cp -rL /usr/src/googletest/googletest/{include,src} "$carry/googletest/"

echo "gpu-carry: programs"
CUDA_ARCHS=${CUDA_ARCHS:-90} scripts/cuda.sh >build/gpu-carry.log 2>&1 ||
  fail "the programs could not be built; the log is build/gpu-carry.log"
mkdir -p "$carry/bin"
cp build/release/umbel_cuda_tests build/release/libumbel_cuda_c.so \
  build/release/bench/{cuda_bench,cuda_bvh_bench,cuda_paths_bench,cuda_query_bench,cuda_frame_example} "$carry/bin/"
strip "$carry"/bin/*

data=${UMBEL_DATA:-../shared/data}
meshes=()
for name in sponza_dabrovic_66k.obj sibenik_75k.ply macross_city.glb littlest_tokyo.glb \
  bench_arch_329k.ply conference_331k.ply dragon_871k.ply head_mri_iso_1437k.ply; do
  if [[ -f $data/$name ]]; then
    meshes+=("$data/$name")
  else
    echo "gpu-carry: there is no $data/$name; the benchmarks go without it"
  fi
done
[[ -n ${MESH:-} ]] && meshes+=("$MESH")
.venv/bin/python -B bench/device_scenes.py "$carry/scenes" "${meshes[@]}"
chmod -R u+w "$carry"

# One archive: machine code packs well, and what may travel is often limited.
tar czf build/gpu-carry.tar.gz -C "$carry" .
rm -rf "$carry"
mkdir "$carry"
mv build/gpu-carry.tar.gz "$carry/carried.tar.gz"
tracked=$(git ls-files -z | xargs -0 du -cb | awk '$2 == "total" { bytes += $1 } END { print bytes }')
carried=$(stat -c %s "$carry/carried.tar.gz")
echo "gpu-carry: $carry has $((carried >> 20)) MiB, the repository's files $((tracked >> 20)) MiB more"
