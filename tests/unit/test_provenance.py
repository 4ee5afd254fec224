# SPDX-License-Identifier: MIT
"""The commit that a report names is the one that is checked out."""

import shutil
import subprocess

import pytest
from analysis_bags import REPOSITORY

from nmpc_control.analysis.provenance import _head, analysed_by, commit


@pytest.mark.skipif(shutil.which("git") is None, reason="no git on this machine")
def test_commit_is_what_git_says():
    command = ["git", "-C", str(REPOSITORY), "rev-parse", "HEAD"]
    result = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    if result.returncode:
        pytest.skip("this is not a repository")
    assert commit() == result.stdout.decode().strip()
    assert commit() in analysed_by().values()


def test_packed_and_detached_heads(tmp_path):
    (tmp_path / "HEAD").write_text("ref: refs/heads/main\n")
    with pytest.raises(OSError, match="packed-refs"):
        _head(tmp_path)
    (tmp_path / "packed-refs").write_text(f"# pack\n{'a' * 40} refs/heads/main\n")
    assert _head(tmp_path) == "a" * 40
    (tmp_path / "HEAD").write_text("b" * 40 + "\n")
    assert _head(tmp_path) == "b" * 40
