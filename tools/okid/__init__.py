# SPDX-License-Identifier: MIT
"""okid: from measured forces and vibrations to modes and a state-space model.

okid.identify(u, y, fs=...) does a whole record; okid.Session does it while samples arrive,
and okid.Accumulator and okid.Identifier are what both are made of.
"""

from importlib import import_module
from typing import Any

from okid import frf, modal
from okid._errors import Error, IdentificationError, InputError
from okid.abi.accumulator import Accumulator
from okid.abi.square_root import SquareRoot
from okid.abi.sums import Stats
from okid.data.records import Record, read_csv
from okid.demo import demo, demo_frame, demo_record
from okid.identification.change_test import ChangeTest, ChangeVerdict, ModeShift
from okid.identification.identifier import Identified, Identifier, usable_p
from okid.identify import identify, stabilization
from okid.identify_frf import identify_frf
from okid.result.modal_table import ModalTable
from okid.result.model import Model
from okid.result.parts import Fit, MassMatrices, Mode, ProportionalDamping
from okid.result.result import Result
from okid.result.stabilization import Cluster, Criteria, OrderPoles, Stabilization
from okid.session import Session
from okid.setups import merge_setups
from okid.structure import Structure

__all__ = [
    "Accumulator",
    "ChangeTest",
    "ChangeVerdict",
    "Cluster",
    "Criteria",
    "Error",
    "Fit",
    "IdentificationError",
    "Identified",
    "Identifier",
    "InputError",
    "MassMatrices",
    "ModalTable",
    "Mode",
    "ModeShift",
    "Model",
    "OrderPoles",
    "ProportionalDamping",
    "Record",
    "Result",
    "Session",
    "SquareRoot",
    "Stabilization",
    "Stats",
    "Structure",
    "demo",
    "demo_frame",
    "demo_record",
    "frf",
    "identify",
    "identify_frf",
    "library_version",
    "merge_setups",
    "modal",
    "read_csv",
    "stabilization",
    "usable_p",
]


# Of okid.formats, in both directions: read_uff, write_uff ..
_FORMATS = ("csv", "frf", "hdf5", "mat", "mdf4", "parquet", "record", "uff")


def __getattr__(name: str) -> Any:
    """Packages that bring other libraries with them load when they are first used: capture (python-can), report
    (matplotlib), formats (read_uff, write_mdf4 .. are its functions), live, campaign (dask).

    okid.__version__ is asked of the C library.
    """
    if name == "__version__":
        from okid.abi import library

        return library().okid_version().decode()
    if name in ("campaign", "capture", "formats", "live", "report"):
        return import_module(f"okid.{name}")
    verb, _, kind = name.partition("_")
    if (verb in ("read", "write") and kind in _FORMATS) or name == "write_result":
        return getattr(import_module("okid.formats"), name)
    raise AttributeError(f"module 'okid' has no attribute {name!r}")


def library_version() -> str:
    """Version and linear-algebra backend of the loaded C library."""
    from okid.abi import library

    return f"{library().okid_version().decode()} ({library().okid_backend().decode()})"
