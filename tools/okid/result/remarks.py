# SPDX-License-Identifier: MIT
"""What the library has to say about a valid model, in words."""

from __future__ import annotations

from okid import abi
from okid.abi.identifier import Identified
from okid.result.parts import Warning as Remark


def _unknowns(found: Identified) -> int:
    """Regressors of an output: q of the observer, or the past and the future inputs of a subspace method."""
    n_y, n_u = found.D.shape
    return int(found.theta.shape[1]) or found.rows * (n_y + 2 * n_u)


def _note_text(found: Identified, code: str) -> str:
    o = found.observer
    texts = {
        "arx_stabilised": f"plain least squares gave an unstable observer (radius {o.radius_plain:.6g}); a ridge of "
        f"{o.ridge:.1e} brought it to {o.radius:.6g}. Damping may come out slightly high",
        "ill_conditioned": f"the regression is ill-conditioned ({o.condition:.1e}): nearly noise-free data, or "
        "channels that repeat each other",
        "few_rows": f"{found.regression_rows} usable rows for {_unknowns(found)} unknowns an output: much scatter",
        "model_unstable": f"the model has a pole outside the unit circle (radius {found.model_radius:.6g})",
        "predictor_unstable": "the predictor A - K C is unstable: no prediction fit is given",
        "order_reduced": f"the order asked for is more than the data can carry; {found.order} is used",
        "order_unclear": f"no clear gap in the singular values: order {found.order} keeps the consistent modes. "
        "Compare a few orders, see stabilization()",
        "literal_hankel": "the Hankel matrix holds [Y_k Y0_k] unscaled (eq. 42 as printed): the result depends on the "
        "units of the inputs, and the observer's own modes mix into the structure's: damping can be wrong by half",
        "weak_excitation": f"the inputs hardly excite some directions (smallest over largest {o.input_excitation:.1e})",
    }
    return texts.get(code, code)


def remarks_of(found: Identified) -> list[Remark]:
    """The notes of the library on a model, in words."""
    out = []
    for bit in range(32):
        if found.notes >> bit & 1:
            name = abi.library().okid_warning_code(1 << bit)
            code = name.decode() if name else f"note_{bit}"
            out.append(Remark(code, _note_text(found, code)))
    return out
