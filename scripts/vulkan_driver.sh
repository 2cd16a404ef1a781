#!/usr/bin/env bash
# Brings Debian 13's software Vulkan driver (Mesa 25, lavapipe), with its loader, headers,
# validation layers and GLSL compiler, into build/vulkan/trixie: extracted, nothing is installed,
# no root needed. It comes from the mirror that this machine's apt uses.
set -euo pipefail
cd "$(dirname "$0")/.."

folder=$PWD/build/vulkan/trixie
[ ! -e "$folder/.complete" ] || exit 0
command -v apt-get >/dev/null || { echo "vulkan: no apt-get to bring a driver with" >&2; exit 3; }

apt=$PWD/build/vulkan/apt
mkdir -p "$apt"/{lists/partial,archives/partial,etc} "$folder"
mirror=$(apt-get indextargets --format '$(SITE)' 'Created-By: Packages' | head -n 1)
keys=/usr/share/keyrings/debian-archive-keyring.gpg
echo "deb [signed-by=$keys] $mirror trixie main" >"$apt/etc/sources.list"
: >"$apt/status"
in_folder() {
  apt-get -q -o Dir::State::lists="$apt/lists" -o Dir::State::status="$apt/status" \
    -o Dir::Cache="$apt" -o Dir::Cache::archives="$apt/archives" \
    -o Dir::Etc::sourcelist="$apt/etc/sources.list" -o Dir::Etc::sourceparts=- \
    -o APT::Get::List-Cleanup=0 -o APT::Install-Recommends=0 -o Debug::NoLocking=1 \
    -o APT::Sandbox::User=root "$@"
}
in_folder update
in_folder install -y --download-only mesa-vulkan-drivers libvulkan-dev vulkan-tools \
  vulkan-validationlayers glslang-tools libglfw3-dev
for package in "$apt"/archives/*.deb; do
  dpkg-deb -x "$package" "$folder"
done
rm -rf "$apt"
touch "$folder/.complete"
