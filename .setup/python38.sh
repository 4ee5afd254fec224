#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Run the core's tests on Python 3.8, the interpreter of Ubuntu 20.04, where one is found besides the workspace's own.
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"

is_38() { "$1" -c 'import sys, venv; sys.exit(sys.version_info[:2] != (3, 8))' 2>/dev/null; }

if is_38 .venv/bin/python3; then
  exit 0
fi
for interpreter in "$(command -v python3.8 || true)" "$(pyenv root 2>/dev/null || true)"/versions/3.8*/bin/python3.8; do
  if [ -x "$interpreter" ] && is_38 "$interpreter"; then
    .setup/python.sh .venv38 "$interpreter"
    echo "[test] core on $(.venv38/bin/python3 --version)"
    # shellcheck disable=SC2086
    exec env -u PYTHONPATH .venv38/bin/python3 -m pytest tests/unit -n 2 --dist worksteal ${PYTEST_ARGS:-}
  fi
done
echo "[test] no Python 3.8 on this machine: the core is tested on $(.venv/bin/python3 --version) alone"
