#!/usr/bin/env bash
# Makes the files of this folder anew from the npm packages named in package.json (their hashes: package-lock.json).
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cp "$here/package.json" "$here/package-lock.json" "$here/three_lean.js" "$work"
cd "$work"
npm ci --ignore-scripts --no-audit --no-fund
npx --no-install esbuild three_lean.js --bundle --minify --format=iife --global-name=THREE --legal-comments=none --charset=ascii \
    --outfile="$here/three.min.js"
cp node_modules/uplot/dist/uPlot.iife.min.js node_modules/uplot/dist/uPlot.min.css "$here"
cp node_modules/three/LICENSE "$here/three.LICENSE"
cp node_modules/uplot/LICENSE "$here/uPlot.LICENSE"
(cd "$here" && sha256sum three.min.js uPlot.iife.min.js uPlot.min.css > SHA256SUMS)
