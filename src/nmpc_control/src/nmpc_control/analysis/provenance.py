# SPDX-License-Identifier: MIT
"""With what a report was made: version and commit of this workspace."""

import re
from pathlib import Path
from typing import Dict

_COMMIT = re.compile(r"[0-9a-f]{40}")
_MOST_LEVELS = 8  # folders above this file that may hold .git


def analysed_by() -> Dict[str, str]:
    """Return what is known of the software that evaluates, by name."""
    return {"Evaluated by commit": commit() or "not known (installed without its repository)"}


def commit() -> str:
    """Return the commit that is checked out around this file, empty if there is none."""
    for folder in list(Path(__file__).resolve().parents)[:_MOST_LEVELS]:
        try:
            return _head(folder / ".git")
        except (OSError, ValueError):
            continue
    return ""


def _head(git: Path) -> str:
    if git.is_file():  # of a worktree: one line that says where it is
        git = Path(git.read_text(encoding="utf-8").partition(":")[2].strip())
    head = (git / "HEAD").read_text(encoding="utf-8").strip()
    if _COMMIT.fullmatch(head):
        return head
    reference = head.partition(":")[2].strip()
    common = git / "commondir"
    root = git / common.read_text(encoding="utf-8").strip() if common.is_file() else git
    loose = root / reference
    if loose.is_file():
        return loose.read_text(encoding="utf-8").strip()
    for line in (root / "packed-refs").read_text(encoding="utf-8").splitlines():
        if line.endswith(f" {reference}"):
            return line.split()[0]
    raise ValueError("no commit")
