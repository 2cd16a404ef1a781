#!/usr/bin/env bash
# Runs a script of viewer/package.json, with its packages installed as the lock file says:
#
#     scripts/node.sh lint
#
# Without Node 20 or newer it says so and does nothing, or fails in CI.
set -euo pipefail
cd "$(dirname "$0")/../viewer"

if ! command -v npm >/dev/null || ! node -e 'process.exit(parseInt(process.versions.node) < 20 ? 1 : 0)'; then
  echo "viewer: $1 is left out: it needs Node 20 or newer"
  exit "$([[ -n ${CI:-} ]] && echo 1 || echo 0)"
fi
if ! cmp -s package-lock.json node_modules/.installed; then
  echo "viewer: installing its packages with npm"
  mkdir -p ../build
  # Not `npm ci`: registries that leave out packages for other systems make it refuse the lock file.
  npm install --no-save --no-progress >../build/npm.log 2>&1 || {
    tail -n 15 ../build/npm.log >&2
    echo "viewer: npm could not install its packages; the log is build/npm.log" >&2
    exit 1
  }
  cp package-lock.json node_modules/.installed
fi
exec npm run --silent "$@"
