# SPDX-License-Identifier: MIT
"""Records, results and CAN logs in the formats of other programs; docs/reference/formats.md tells what each one keeps.

read_record() and write_record() go by the file name's extension. Libraries of a format are loaded when it is used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from okid.data.geometry import Geometry
    from okid.data.records import Record, read_csv
    from okid.formats.by_name import read_record, write_record, write_result
    from okid.formats.can_log import convert_log, read_log, write_log
    from okid.formats.csv_file import write_csv
    from okid.formats.frf_file import read_frf, write_frf
    from okid.formats.geometry_file import read_geometry
    from okid.formats.hdf5 import read_hdf5, write_hdf5
    from okid.formats.logger_text import read_logger
    from okid.formats.mat import read_mat, write_mat
    from okid.formats.mcap_file import read_mcap, write_events_mcap, write_mcap
    from okid.formats.mdf4 import read_mdf4, write_mdf4
    from okid.formats.parquet import read_parquet, write_parquet
    from okid.formats.sound import read_sound
    from okid.formats.tdms import read_tdms
    from okid.formats.uff import UffFile, read_uff, write_uff
    from okid.formats.uff_function import UffFunction
    from okid.formats.uff_model import UffMode

__all__ = [
    "Geometry",
    "Record",
    "UffFile",
    "UffFunction",
    "UffMode",
    "convert_log",
    "read_csv",
    "read_frf",
    "read_geometry",
    "read_hdf5",
    "read_log",
    "read_logger",
    "read_mat",
    "read_mcap",
    "read_mdf4",
    "read_parquet",
    "read_record",
    "read_sound",
    "read_tdms",
    "read_uff",
    "write_csv",
    "write_events_mcap",
    "write_frf",
    "write_hdf5",
    "write_log",
    "write_mat",
    "write_mcap",
    "write_mdf4",
    "write_parquet",
    "write_record",
    "write_result",
    "write_uff",
]

_NAMES = {
    "okid.formats.by_name": "read_record, write_record, write_result",
    "okid.formats.csv_file": "write_csv",
    "okid.formats.can_log": "convert_log, read_log, write_log",
    "okid.formats.frf_file": "read_frf, write_frf",
    "okid.formats.geometry_file": "read_geometry",
    "okid.formats.hdf5": "read_hdf5, write_hdf5",
    "okid.formats.logger_text": "read_logger",
    "okid.formats.mat": "read_mat, write_mat",
    "okid.formats.mcap_file": "read_mcap, write_events_mcap, write_mcap",
    "okid.formats.mdf4": "read_mdf4, write_mdf4",
    "okid.formats.parquet": "read_parquet, write_parquet",
    "okid.formats.sound": "read_sound",
    "okid.formats.tdms": "read_tdms",
    "okid.formats.uff": "UffFile, read_uff, write_uff",
    "okid.formats.uff_function": "UffFunction",
    "okid.formats.uff_model": "UffMode",
    "okid.data.geometry": "Geometry",
    "okid.data.records": "Record, read_csv",
}  # of the modules; they load when they are first used: some bring scipy or python-can with them


def __getattr__(name: str) -> Any:
    for module, names in _NAMES.items():
        if name in names.split(", "):
            return getattr(import_module(module), name)
    raise AttributeError(f"module 'okid.formats' has no attribute {name!r}")
