# SPDX-License-Identifier: MIT
"""modred: OKID(inputs, outputs, num_Markovs), make_sampled_format, ERA on the Markov parameters behind D: A, B, C.

Settings: num_Markovs = 2 s + 2 (it is the observer order too, and gives s block rows and columns), true order.
"""

from __future__ import annotations

from typing import Any

import modred
from adapters.shapes import columns


def _modred(problem: Any) -> Any:
    markov = modred.OKID(columns(problem.u), columns(problem.y), 2 * problem.rows + 2)[1:]
    _, sampled = modred.make_sampled_format(range(len(markov)), markov)
    return modred.ERA(verbosity=0).compute_model(sampled, problem.order)[0]


WAYS = {"OKID + ERA": _modred}
