# SPDX-License-Identifier: MIT
"""A signal from one thread to another that waits, on a clock that nobody sets.

``threading.Event.wait`` with a limit counts on the computer's clock up to Python 3.8: while that is
set back, it goes on waiting.
"""

import os
import select


class WakeUp:
    """Calls of ``set`` wake who waits, or will."""

    def __init__(self) -> None:
        self._read, self._write = os.pipe()
        os.set_blocking(self._read, False)
        os.set_blocking(self._write, False)

    def set(self) -> None:
        """Wake who waits; callable from any thread, never waits itself."""
        try:
            os.write(self._write, b"!")
        except BlockingIOError:
            pass  # thousands that nobody has read: it is set

    def clear(self) -> None:
        """Forget the calls of ``set`` so far."""
        try:
            while os.read(self._read, 4096):
                pass
        except BlockingIOError:
            pass

    def wait(self, limit: float) -> bool:
        """Wait until set, at most ``limit`` [s]; return whether it is."""
        return bool(select.select([self._read], [], [], max(0.0, limit))[0])
