# SPDX-License-Identifier: MIT
"""okid: from measured forces and vibrations to modes and a state-space model.

okid.identify(u, y, fs=...) does a whole record; okid.Session does it while samples arrive,
and okid.Accumulator and okid.Identifier are what both are made of.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from okid._errors import Error, IdentificationError, InputError
from okid.record.demo import demo, demo_frame, demo_record
from okid.record.identify import identify, stabilization
from okid.record.identify_frf import identify_frf

if TYPE_CHECKING:
    from okid import frf, modal
    from okid.abi.accumulator import Accumulator
    from okid.abi.square_root import SquareRoot
    from okid.abi.sums import Stats
    from okid.data.records import Record, read_csv
    from okid.identification.change_test import ChangeTest, ChangeVerdict, ModeShift
    from okid.identification.identifier import Identified, Identifier, usable_p
    from okid.mechanics.grey_box import FittedMode, GreyBox, fit_structure
    from okid.mechanics.structure import Structure
    from okid.mechanics.virtual import Estimate, VirtualSensors
    from okid.record.setups import identify_setups, merge, merge_setups
    from okid.result.comparison import ComparedMode, ComparedPair, Comparison, compare
    from okid.result.modal_table import ModalTable
    from okid.result.model import Model
    from okid.result.parts import Fit, MassMatrices, Mode, ProportionalDamping
    from okid.result.result import Result
    from okid.result.stabilization import Cluster, Criteria, OrderPoles, Stabilization
    from okid.session import Session

__all__ = [
    "Accumulator",
    "ChangeTest",
    "ChangeVerdict",
    "Cluster",
    "ComparedMode",
    "ComparedPair",
    "Comparison",
    "Criteria",
    "Error",
    "Estimate",
    "Fit",
    "FittedMode",
    "GreyBox",
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
    "VirtualSensors",
    "compare",
    "demo",
    "demo_frame",
    "demo_record",
    "fit_structure",
    "frf",
    "identify",
    "identify_frf",
    "identify_setups",
    "library_version",
    "merge",
    "merge_setups",
    "modal",
    "read_csv",
    "stabilization",
    "usable_p",
]


_NAMES = {
    "abi.accumulator": "Accumulator",
    "abi.square_root": "SquareRoot",
    "abi.sums": "Stats",
    "data.records": "Record, read_csv",
    "mechanics.grey_box": "FittedMode, GreyBox, fit_structure",
    "identification.change_test": "ChangeTest, ChangeVerdict, ModeShift",
    "identification.identifier": "Identified, Identifier, usable_p",
    "result.comparison": "ComparedMode, ComparedPair, Comparison, compare",
    "result.modal_table": "ModalTable",
    "result.model": "Model",
    "result.parts": "Fit, MassMatrices, Mode, ProportionalDamping",
    "result.result": "Result",
    "result.stabilization": "Cluster, Criteria, OrderPoles, Stabilization",
    "session": "Session",
    "record.setups": "identify_setups, merge, merge_setups",
    "mechanics.structure": "Structure",
    "mechanics.virtual": "Estimate, VirtualSensors",
}  # of the modules; they load when they are first used, NumPy and the libraries with them

_MODULES = ("campaign", "capture", "formats", "frf", "live", "modal", "notebook", "plots", "report")

# Of okid.formats, in both directions: read_uff, write_uff ..
_FORMATS = ("csv", "frf", "hdf5", "mat", "mcap", "mdf4", "parquet", "record", "sound", "tdms", "uff")


def __getattr__(name: str) -> Any:
    """Everything loads when it is first used, the packages that bring other libraries with them, too: capture
    (python-can), report and plots (matplotlib), notebook (anywidget), formats (read_uff, write_mdf4 .. are its
    functions), live, campaign (dask).

    okid.__version__ is asked of the C library.
    """
    if name == "__version__":
        from okid.abi import library

        return library().okid_version().decode()
    if name in _MODULES:
        return import_module(f"okid.{name}")
    for module, names in _NAMES.items():
        if name in names.split(", "):
            globals()[name] = found = getattr(import_module(f"okid.{module}"), name)
            return found
    verb, _, kind = name.partition("_")
    if (verb in ("read", "write") and kind in _FORMATS) or name == "write_result":
        return getattr(import_module("okid.formats"), name)
    raise AttributeError(f"module 'okid' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__, *_MODULES})


def library_version() -> str:
    """Version and linear-algebra backend of the loaded C library."""
    from okid.abi import library

    return f"{library().okid_version().decode()} ({library().okid_backend().decode()})"
