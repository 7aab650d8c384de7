# SPDX-License-Identifier: MIT
"""okid: from measured forces and vibrations to modes and a state-space model.

okid.identify(u, y, fs=...) does a whole record; okid.Accumulator and okid.Identifier do it while samples arrive.
"""

from importlib import import_module
from typing import Any

from okid import frf, modal
from okid._errors import Error, IdentificationError, InputError
from okid.accumulator import Accumulator
from okid.demo import demo
from okid.identifier import Identified, Identifier, usable_p
from okid.identify import identify
from okid.mkr import MassMatrices, ProportionalDamping
from okid.model import Model
from okid.records import read_csv
from okid.result import Fit, Mode, Result
from okid.square_root import SquareRoot
from okid.stabilization import Cluster, Criteria, OrderPoles, Stabilization, stabilization
from okid.sums import Stats

__all__ = [
    "Accumulator",
    "Cluster",
    "Criteria",
    "Error",
    "Fit",
    "IdentificationError",
    "Identified",
    "Identifier",
    "InputError",
    "MassMatrices",
    "Mode",
    "Model",
    "OrderPoles",
    "ProportionalDamping",
    "Result",
    "SquareRoot",
    "Stabilization",
    "Stats",
    "demo",
    "frf",
    "identify",
    "library_version",
    "modal",
    "read_csv",
    "stabilization",
    "usable_p",
]


def __getattr__(name: str) -> Any:
    """okid.capture and okid.report load when they are first used: they bring python-can and matplotlib with them.

    okid.__version__ is asked of the C library.
    """
    if name == "__version__":
        from okid._abi import library

        return library().okid_version().decode()
    if name in ("capture", "report"):
        return import_module(f"okid.{name}")
    raise AttributeError(f"module 'okid' has no attribute {name!r}")


def library_version() -> str:
    """Version and linear-algebra backend of the loaded C library."""
    from okid._abi import library

    return f"{library().okid_version().decode()} ({library().okid_backend().decode()})"
