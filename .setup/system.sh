#!/usr/bin/env bash
# SPDX-License-Identifier: MIT
# Install the system packages that are missing; touches no network if none is.
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"
lock

. /etc/os-release
if [ -d /opt/ros/noetic ] || [ "${VERSION_CODENAME:-}" = focal ]; then
  platform=noetic
elif [ "${VERSION_CODENAME:-}" = bookworm ]; then
  platform=debian
else
  fail "Debian 12 or Ubuntu 20.04 is needed, this is ${PRETTY_NAME:-unknown}"
fi

missing=()
for package in $(sed 's/#.*//' ".setup/packages-$platform.txt"); do
  status="$(dpkg-query --show --showformat='${db:Status-Status}' "$package" 2>/dev/null || true)"
  [ "$status" = installed ] || missing+=("$package")
done
[ ${#missing[@]} -gt 0 ] || exit 0

if [ "$(id -u)" -ne 0 ]; then
  fail "system packages are missing; run: sudo apt-get update && sudo apt-get install --yes --no-install-recommends ${missing[*]}"
fi
export DEBIAN_FRONTEND=noninteractive
step apt-update "reading the package lists" "apt-get update failed: see the lines above, repair, and run make again" \
  apt-get update
if [ "$platform" = noetic ] && ! apt-cache show ros-noetic-ros-base >/dev/null 2>&1; then
  fail "ros-noetic-ros-base cannot be found: add ROS's apt source (wiki.ros.org/noetic/Installation/Ubuntu, 1.2 and 1.3), then run make again"
fi
step apt-install "installing ${#missing[@]} system packages and what they need" \
  "apt-get install failed: see the lines above, repair, and run make again" \
  apt-get install --yes --no-install-recommends "${missing[@]}"
