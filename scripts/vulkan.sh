#!/usr/bin/env bash
# examples/vulkan: builds it against the library in build/release, installed, and runs its tests
# headless with the validation layers. What this machine lacks (a driver of Vulkan 1.3 with mesh
# shaders, headers, the GLSL compiler) scripts/vulkan_driver.sh brings. VULKAN_DRIVER=system uses
# the machine's own. Where neither can be had, it says so and ends well.
set -euo pipefail
cd "$(dirname "$0")/.."

work=$PWD/build/vulkan
mkdir -p "$work/include"
run=() headers=() glslang=()
if [[ ${VULKAN_DRIVER:-} != system ]]; then
  if ! scripts/vulkan_driver.sh >"$work/driver.log" 2>&1; then
    tail -n 3 "$work/driver.log" >&2
    echo "vulkan: skipped: no driver can be had here; VULKAN_DRIVER=system uses this machine's own"
    exit 0
  fi
  files=$work/trixie/usr
  libraries=$files/lib/x86_64-linux-gnu
  # The programs run with Debian 13's own C library, which the driver needs.
  run=("$libraries/ld-linux-x86-64.so.2" --library-path "$libraries")
  # Only these headers: the others are of another C library.
  ln -sfn "$files/include/vulkan" "$work/include/vulkan"
  ln -sfn "$files/include/vk_video" "$work/include/vk_video"
  ln -sfn "$files/include/GLFW" "$work/include/GLFW"
  printf -v glslang '%s;' "${run[@]}"
  headers=(-DVULKAN_HEADERS="$work/include" -DGLSLANG="$glslang$files/bin/glslangValidator"
    -DGLFW_HEADERS="$work/include" -DGLFW_LIBRARY="$libraries/libglfw.so"
    -DCMAKE_EXE_LINKER_FLAGS=-Wl,--allow-shlib-undefined)
  export VK_DRIVER_FILES=$files/share/vulkan/icd.d/lvp_icd.json
  export VK_LAYER_PATH=$files/share/vulkan/explicit_layer.d
fi

# The toolkit that umbel::cuda was built with, if it was.
cuda=$(sed -n 's/^CUDAToolkit_ROOT:[A-Z]*=//p' build/release/CMakeCache.txt)
tbb=$(sed -n 's/^TBB_DIR:[A-Z]*=//p' build/release/CMakeCache.txt)
{
  cmake --install build/release --prefix "$work/prefix" --component library
  cmake -S examples/vulkan -B "$work/program" -G Ninja -DCMAKE_BUILD_TYPE=Release \
    -DCMAKE_PREFIX_PATH="$work/prefix" -DTBB_DIR="$tbb" ${cuda:+-DCUDAToolkit_ROOT="$cuda"} "${headers[@]}"
  cmake --build "$work/program"
} >"$work/build.log" 2>&1 || { cat "$work/build.log" >&2; exit 1; }

status=0
"${run[@]}" "$work/program/umbel_vulkan_check" "$work/check" || status=$?
((status == 77)) && exit 0
((status == 0)) || exit "$status"
"${run[@]}" "$work/program/umbel_vulkan" --instances 1000 --frames 8 --looks clusters --validate \
  --headless --error 4 --out "$work/frames"
"${run[@]}" "$work/program/umbel_vulkan" --instances 100 --frames 4 --looks shaded --validate \
  --trace --headless --error 4 --out "$work/traced" || (($? == 77))
"${run[@]}" "$work/program/umbel_vulkan_deform" --frames 8 --size 320 240 --validate \
  --out "$work/deform" || (($? == 77))
# The window, where there is a server of pictures without a screen.
if command -v xvfb-run >/dev/null; then
  xvfb-run -a "${run[@]}" "$work/program/umbel_vulkan" --instances 100 --frames 10 --validate \
    --error 4 --size 320 240 --out "$work/frames"
else
  echo "vulkan: the window is not tested: no xvfb-run"
fi
