#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Build the catkin workspace, unless nothing that a build reads has changed since the last one.
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"
lock

# DJI's own package wins: under src/, or in a workspace that has been sourced.
ours=src/dji_sdk
others="$(tr ':' '\n' <<<"${ROS_PACKAGE_PATH:-}" | grep -vxF "$PWD/src" | paste -sd ':' || true)"
if grep -rlsE --include=package.xml '<name> *dji_sdk *</name>' src | grep -qvxF "$ours/package.xml" ||
  ROS_PACKAGE_PATH="$others" rospack find dji_sdk >/dev/null 2>&1; then
  touch "$ours/CATKIN_IGNORE"
else
  rm -f "$ours/CATKIN_IGNORE"
fi

python="$PWD/.venv/bin/python3"
sources="$(find -L src -mindepth 2 -not -path '*/.*' -not -name '*.pyc' -type f \( -name CMakeLists.txt -o -name package.xml -o -name setup.py \
  -o -name CATKIN_IGNORE -o -name '*.msg' -o -name '*.srv' -o -name '*.action' -o -path '*/nodes/*' -o -path '*/scripts/*' \) \
  -print0 | sort -z | xargs -0 sha256sum)"
wanted="$PWD ${CMAKE_PREFIX_PATH:-} $sources"
if [ -f devel/setup.bash ] && [ "$(cat build/.sources 2>/dev/null)" = "$wanted" ]; then
  exit 0
fi

if ! grep -qsxF "CMAKE_HOME_DIRECTORY:INTERNAL=$PWD/src" build/CMakeCache.txt; then
  rm -rf build/CMakeCache.txt build/CMakeFiles devel # of another place, or none
fi
rm -f build/.sources
step catkin "building the workspace" "the build failed: see the lines above" \
  catkin_make --no-color -DPYTHON_EXECUTABLE="$python"
echo "$wanted" >build/.sources
