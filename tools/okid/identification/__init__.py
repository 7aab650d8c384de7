# SPDX-License-Identifier: MIT
"""Identification by the libraries: of sums (identifier), of records (host_result), of a stream."""
