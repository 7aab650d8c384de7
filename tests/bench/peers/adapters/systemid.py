# SPDX-License-Identifier: MIT
"""systemID: its OKID with observer, Markov parameters, ERA functions: A, B, C, D.

`import systemID` of this release fails (it imports a systemID.functions that is not shipped): an empty package of that
name with the right path lets its core modules load. Settings: observer_order = s, 2 s + 1 Markov parameters, p = q = s
blocks, true order.
"""

from __future__ import annotations

import importlib.util
import sys
import types
from typing import Any

import numpy as np
from adapters.shapes import columns

_spec = importlib.util.find_spec("systemID")
if _spec is None or _spec.submodule_search_locations is None:
    raise ImportError("systemID is not installed")
for _name, _tail in (("systemID", ""), ("systemID.core", "/core"), ("systemID.core.algorithms", "/core/algorithms")):
    _shell = types.ModuleType(_name)
    _shell.__path__ = [place + _tail for place in _spec.submodule_search_locations]
    sys.modules[_name] = _shell
_algorithms = "systemID.core.algorithms."
_okid = importlib.import_module(_algorithms + "observer_kalman_identification_algorithm_with_observer")
_markov = importlib.import_module(_algorithms + "markov_parameters_from_observer_markov_parameters")
_era = importlib.import_module(_algorithms + "eigensystem_realization_algorithm")


def _systemid(problem: Any) -> Any:
    u, y = columns(problem.u)[:, :, np.newaxis], columns(problem.y)[:, :, np.newaxis]
    seen = _okid.observer_kalman_identification_algorithm_with_observer(
        u, y, observer_order=problem.rows, stable_order=problem.rows
    )
    count = 2 * problem.rows + 2
    h = _markov.markov_parameters_from_observer_markov_parameters(seen["observer_markov_parameters"], count)
    made = _era.eigensystem_realization_algorithm(h["markov_parameters"], problem.order, problem.rows, problem.rows)
    return made["A"](0.0)


WAYS = {"OKID + ERA": _systemid}
