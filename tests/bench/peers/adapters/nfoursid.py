# SPDX-License-Identifier: MIT
"""nfoursid: NFourSID(dataframe, ...).subspace_identification(), .system_identification(rank): A, B, C, D, covariances.

Settings: num_block_rows = s, rank = true order.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from nfoursid.nfoursid import NFourSID


def _nfoursid(problem: Any) -> Any:
    ins, outs = ([f"{kind}{k}" for k in range(x.shape[1])] for kind, x in (("u", problem.u), ("y", problem.y)))
    frame = pd.DataFrame(np.hstack([problem.u, problem.y]), columns=ins + outs)
    method = NFourSID(frame, outs, ins, num_block_rows=problem.rows)
    method.subspace_identification()
    return method.system_identification(rank=problem.order)[0].a


WAYS = {"PO-MOESP": _nfoursid}
