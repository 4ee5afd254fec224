# SPDX-License-Identifier: MIT
"""Finished flights on disk, one line each as they end, so that a campaign can go on.

The first line says what the campaign is; rows of another one are refused.
"""

import dataclasses
import hashlib
import json
from pathlib import Path
from typing import Any, Dict, List, Optional, TextIO

import nmpc_control
import uav_sim
from nmpc_control.config import config_directory
from nmpc_control.errors import ConfigError
from uav_sim.closed_loop.campaign.settings import Settings
from uav_sim.config import config_directory as simulator_config


class Ledger:
    """Rows of a campaign in a file beside its JSON; without a file, in memory only."""

    def __init__(self, path: Optional[Path], settings: Settings, resume: bool = False) -> None:
        self.rows: Dict[int, Dict[str, Any]] = {}
        self._file: Optional[TextIO] = None
        if path is None:
            return
        header = {"campaign": _plain(settings), "software": digest()}
        if resume and path.exists():
            self._read(path, header)
        lines = [header, *(self.rows[i] for i in sorted(self.rows))]
        text = "".join(json.dumps(line, allow_nan=False) + "\n" for line in lines)
        path.write_text(text, encoding="utf-8")  # also drops a line that was cut off
        self._file = path.open("a", encoding="utf-8")

    def add(self, row: Dict[str, Any]) -> None:
        """Take a finished row."""
        self.rows[row["index"]] = row
        if self._file is not None:
            self._file.write(json.dumps(row, allow_nan=False) + "\n")
            self._file.flush()

    def close(self) -> None:
        """Close the file."""
        if self._file is not None:
            self._file.close()

    def _read(self, path: Path, header: Dict[str, Any]) -> None:
        lines = path.read_text(encoding="utf-8").splitlines()
        found = _parsed(lines[:1])
        for part in ("campaign", "software"):
            if not found or found[0].get(part) != header[part]:
                expected = f"the same {part} as now; without --resume it begins anew"
                raise ConfigError(path.name, part, "another one", expected)
        self.rows = {row["index"]: row for row in _parsed(lines[1:])}


def _parsed(lines: List[str]) -> List[Dict[str, Any]]:
    """Return what complete lines hold."""
    rows = []
    for line in lines:
        try:
            row = json.loads(line)
        except ValueError:
            continue
        if isinstance(row, dict):
            rows.append(row)
    return rows


def _plain(settings: Settings) -> Dict[str, Any]:
    return json.loads(json.dumps(dataclasses.asdict(settings)))


def digest() -> str:
    """Return a fingerprint of all sources and presets that decide a flight."""
    total = hashlib.sha256()
    packages = [Path(str(p.__file__)).parent for p in (nmpc_control, uav_sim)]
    for folder in (*packages, config_directory(), simulator_config()):
        for path in sorted([*folder.rglob("*.py"), *folder.rglob("*.yaml")]):
            total.update(path.relative_to(folder).as_posix().encode())
            total.update(path.read_bytes())
    return total.hexdigest()[:16]
