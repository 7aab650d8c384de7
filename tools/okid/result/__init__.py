# SPDX-License-Identifier: MIT
"""What an identification gives: models, modes, matrices, tables, pictures."""
