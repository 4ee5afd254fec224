# SPDX-License-Identifier: MIT
# What the set-up steps share: one line per step, a log file, and one line on failure.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
mkdir -p build logs
offline='temporary failure|could not resolve|name or service not known|network is unreachable'
offline="$offline|could not connect|unable to connect|failed to establish a new connection"

fail() {
  echo "[setup] $1" >&2
  exit 1
}

# Let only one make at a time change the machine or the workspace.
lock() {
  exec 9>build/.lock
  flock 9
}

# step LOG TITLE HINT COMMAND...: run the command quietly; on failure show the log's end and the hint.
step() {
  local log="logs/$1.log" title="$2" hint="$3"
  shift 3
  echo "[setup] $title (log: $log)"
  if "$@" >"$log" 2>&1; then
    return
  fi
  if grep -qiE "$offline" "$log"; then
    fail "no network: connect this machine and run make again"
  fi
  tail -n 15 "$log" >&2
  fail "$hint"
}

# Source a setup file of ROS, which does not stand `set -u`.
source_ros() {
  set +u
  # shellcheck disable=SC1090
  . "$1"
  set -u
}

if [ -z "${CMAKE_PREFIX_PATH:-}" ] && [ -f /opt/ros/noetic/setup.bash ]; then
  source_ros /opt/ros/noetic/setup.bash
fi
