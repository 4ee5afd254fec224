# SPDX-License-Identifier: MIT
"""CasADi functions as compiled C.

Generated once, cached by source, compiler, flags and processor.
"""

import ctypes
import hashlib
import logging
import os
import platform
import shutil
import subprocess
import tempfile
from functools import partial
from pathlib import Path
from typing import Callable, Dict, Optional, Sequence

import casadi as ca
import numpy as np

LOGGER = logging.getLogger(__name__)
# no -ffast-math: it makes NaN checks lie and flushes denormals for the whole process; gnu90 lets
# CasADi write fmin as a comparison, and without interposition its helpers are inlined: together
# a third faster
FLAGS = (
    "-O3",
    "-march=native",
    "-std=gnu90",
    "-fno-math-errno",
    "-fno-semantic-interposition",
    "-fPIC",
    "-shared",
)


def cache_directory() -> Path:
    """Return the folder for compiled code: ``$NMPC_CACHE`` or ``~/.cache/nmpc_control``."""
    default = Path(os.path.expanduser("~")) / ".cache" / "nmpc_control"
    return Path(os.environ.get("NMPC_CACHE", default))


def compile_functions(
    functions: Sequence[ca.Function], compiler: str = "cc"
) -> Dict[str, ca.Function]:
    """Return the functions as compiled code, by name; as they are where there is no compiler."""
    interpreted = {f.name(): f for f in functions}
    program = shutil.which(compiler)
    if program is None:
        LOGGER.warning(
            "no C compiler %r: solving with CasADi's interpreter, about ten times slower", compiler
        )
        return interpreted
    for _ in range(2):
        try:
            library = _library(functions, program)
            return {name: Native(name, library) for name in interpreted}
        except (OSError, subprocess.CalledProcessError) as error:
            detail = getattr(error, "stderr", "") or str(error)
            break
        except RuntimeError as error:  # a file that the power went off under
            detail = str(error)
            library.unlink()
    LOGGER.warning(
        "compilation failed, solving with CasADi's interpreter: %s", detail.strip()[-500:]
    )
    return interpreted


def _library(functions: Sequence[ca.Function], program: str) -> Path:
    generator = ca.CodeGenerator("nmpc.c", {"with_header": False})
    for function in functions:
        generator.add(function)
    source = generator.dump()
    version = subprocess.run(
        [program, "--version"], check=True, capture_output=True, text=True
    ).stdout
    key = "\0".join([source, version, " ".join(FLAGS), _processor(), ca.__version__])
    directory = cache_directory()
    directory.mkdir(parents=True, exist_ok=True)
    library = directory / f"nmpc_{hashlib.sha256(key.encode()).hexdigest()[:32]}.so"
    if library.exists():
        return library
    with tempfile.TemporaryDirectory(dir=directory) as folder:
        c_file, product = Path(folder) / "nmpc.c", Path(folder) / "nmpc.so"
        c_file.write_text(source)
        subprocess.run(
            [program, *FLAGS, str(c_file), "-o", str(product), "-lm"],
            check=True,
            capture_output=True,
            text=True,
        )
        with open(product, "rb") as written:
            os.fsync(written.fileno())
        os.replace(product, library)  # atomic: another process may be doing the same
    return library


def _processor() -> str:
    """Return a text that changes with the instruction set that -march=native means here."""
    try:
        for line in Path("/proc/cpuinfo").read_text().splitlines():
            if line.startswith(("flags", "Features")):
                return line
    except OSError:
        pass
    return f"{platform.machine()} {platform.processor()}"


class Native(ca.Function):
    """A function of a compiled library, which it remembers."""

    def __init__(self, name: str, library: Path) -> None:
        """Load it; raises RuntimeError where the file holds no such function."""
        super().__init__(ca.external(name, str(library)))
        self.library = library


class Buffered:
    """A CasADi function called through fixed buffers, without allocation.

    Compiled code is called with Python's lock held: a solve is some twenty calls of a tenth of a
    millisecond, and at each release a thread that reads messages would come in between.

    ``inputs[name]`` and ``outputs[name]`` are numpy arrays (Fortran order) that the call reads and
    writes.
    """

    def __init__(
        self, function: ca.Function, shared: Optional[Dict[str, np.ndarray]] = None
    ) -> None:
        self._function = function
        self.inputs: Dict[str, np.ndarray] = {}
        self.outputs: Dict[str, np.ndarray] = {}
        for i in range(function.n_in()):
            array = self._array(function.name_in(i), function.size_in(i), shared)
            self.inputs[function.name_in(i)] = array
        for i in range(function.n_out()):
            array = self._array(function.name_out(i), function.size_out(i), shared)
            self.outputs[function.name_out(i)] = array
        self._call = self._native() if isinstance(function, Native) else self._interpreted()

    def _native(self) -> Callable[[], int]:
        """Return the call of the compiled function by CasADi's C interface."""
        f = self._function
        pointer = ctypes.c_void_p
        arguments = (pointer * f.sz_arg())(*(a.ctypes.data for a in self.inputs.values()))
        results = (pointer * f.sz_res())(*(a.ctypes.data for a in self.outputs.values()))
        work = (ctypes.c_longlong * (f.sz_iw() + 1))(), (ctypes.c_double * (f.sz_w() + 1))()
        memory = (arguments, results, *work)
        function = getattr(ctypes.PyDLL(str(f.library)), f.name())
        function.argtypes, function.restype = [*[pointer] * 4, ctypes.c_int], ctypes.c_int
        return partial(function, *map(ctypes.cast, memory, [pointer] * 4), 0)

    def _interpreted(self) -> Callable[[], int]:
        buffer, trigger = self._function.buffer()
        for i, array in enumerate(self.inputs.values()):
            buffer.set_arg(i, memoryview(array.T))
        for i, array in enumerate(self.outputs.values()):
            buffer.set_res(i, memoryview(array.T))

        def call() -> int:
            trigger()
            return buffer.ret()

        return call

    @staticmethod
    def _array(
        name: str, size: Sequence[int], shared: Optional[Dict[str, np.ndarray]]
    ) -> np.ndarray:
        if shared is not None and name in shared:
            return shared[name]
        array = np.zeros(tuple(size), order="F")
        if shared is not None:
            shared[name] = array
        return array

    def __call__(self) -> bool:
        """Evaluate; returns whether the function reported success."""
        return self._call() == 0
