#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Make a virtual environment with the pinned packages: python.sh FOLDER INTERPRETER [VENV OPTION...].
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"
lock

folder="$1" interpreter="$2"
shift 2
name="${folder#.}"
made="$PWD/$folder $interpreter $*" # a moved workspace or another interpreter needs a new environment
packages="$(sha256sum <requirements.txt)"

if [ "$(cat "$folder/.made" 2>/dev/null)" != "$made" ] || ! "$folder/bin/python3" -c "" 2>/dev/null; then
  step "$name-create" "making the virtual environment $folder" \
    "$interpreter could not make a virtual environment: see the lines above" \
    "$interpreter" -m venv --clear "$@" "$folder"
  echo "$made" >"$folder/.made"
fi
if [ "$(cat "$folder/.packages" 2>/dev/null)" != "$packages" ]; then
  install=("$folder/bin/python3" -m pip install --disable-pip-version-check)
  hint="pip could not install requirements.txt: see the lines above, repair, and run make again"
  step "$name-pip" "updating pip in $folder" "$hint" "${install[@]}" pip==25.0.1 # knows today's wheel names
  step "$name-packages" "installing Python packages into $folder" "$hint" "${install[@]}" --requirement requirements.txt
  echo "$packages" >"$folder/.packages"
fi
