#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Build the catkin workspace, unless nothing that a build reads has changed since the last one.
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"
lock

without_ours() { tr ':' '\n' <<<"$1" | grep -vE "^($PWD/(src|devel|install))?\$" | paste -sd ':' || true; }
packages_around="$(without_ours "${ROS_PACKAGE_PATH:-}")"
prefixes_around="$(without_ours "${CMAKE_PREFIX_PATH:-}")"

# DJI's own package wins: elsewhere under src/, or in a workspace that has been sourced.
beside="$(grep -rlsE --include=package.xml '<name> *dji_sdk *</name>' src | grep -vxF src/dji_sdk/package.xml || true)"
if [ -n "$beside" ] || ROS_PACKAGE_PATH="$packages_around" rospack find dji_sdk >/dev/null 2>&1; then
  touch src/dji_sdk/CATKIN_IGNORE
else
  rm -f src/dji_sdk/CATKIN_IGNORE
fi

sources="$(find -L src -mindepth 2 -not -path '*/.*' -not -name '*.pyc' -type f \( -name CMakeLists.txt -o -name package.xml \
  -o -name setup.py -o -name CATKIN_IGNORE -o -name '*.msg' -o -name '*.srv' -o -name '*.action' -o -name '*.cfg' \
  -o -path '*/nodes/*' -o -path '*/scripts/*' \) -print0 | sort -z | xargs -0 sha256sum)"
place="$PWD $prefixes_around $beside $(find src -name CATKIN_IGNORE)" # what a build cannot be carried over from
if [ -f devel/setup.bash ] && [ "$(cat build/.built 2>/dev/null)" = "$place $sources" ]; then
  exit 0
fi
if [ "$(cat build/.place 2>/dev/null)" != "$place" ]; then
  rm -rf devel build/CMakeCache.txt build/CMakeFiles build/catkin build/catkin_generated
fi
rm -f build/.built
echo "$place" >build/.place
step catkin "building the workspace" "the build failed: see the lines above" \
  catkin_make --no-color -DPYTHON_EXECUTABLE="$PWD/.venv/bin/python3"
step solver "compiling the solver" "the solver does not compile: see the lines above" \
  env PYTHONPATH=src/nmpc_control/src .venv/bin/python3 -c \
  "from nmpc_control.nmpc import Nmpc; from nmpc_control.params import load_parameters; Nmpc(load_parameters())"
echo "$place $sources" >build/.built
