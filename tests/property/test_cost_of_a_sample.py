# SPDX-License-Identifier: MIT
"""What a sample costs: m^2 (p+1) multiply-adds and nothing that grows with the record. Counted are lines run, by gcov.

No clock is read: okid_core.c is compiled without optimisation, and a run of more samples less a run of fewer is what
the samples between cost.
"""

from __future__ import annotations

import json
import subprocess
from functools import lru_cache
from pathlib import Path

import core_feed
import pytest

FEED = r"""
#include "okid_core.h"
#include <stdlib.h>
int main(int argc, char** argv) {
    (void)argc;
    const int n_u = atoi(argv[1]), n_y = atoi(argv[2]), p = atoi(argv[3]), count = atoi(argv[4]);
    okid_accumulator_config_t c = okid_accumulator_defaults(n_u, n_y, p);
    c.sample = OKID_SAMPLE_INT16;
    const size_t bytes = okid_accumulator_memsize(&c);
    okid_accumulator_t* a;
    if (okid_accumulator_create(&a, &c, malloc(bytes), bytes) != OKID_OK) return 1;
    int16_t codes[16];
    unsigned state = 1;
    for (int n = 0; n < count; ++n) {
        for (int k = 0; k < n_u + n_y; ++k) codes[k] = (int16_t)((state = state * 1103515245u + 12345u) >> 18);
        if (okid_accumulator_add_i16(a, codes, 1) != OKID_OK) return 2;
    }
    return okid_accumulator_rows(a) == count - p ? 0 : 3;
}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    it = tmp_path_factory.mktemp("cost")
    core_feed.generate(it)
    (it / "cost.c").write_text(FEED)
    for source in ("cost.c", "okid_core.c"):
        coverage = ["--coverage"] if source == "okid_core.c" else []
        subprocess.run(["gcc", "-std=c11", "-O0", *coverage, "-c", source], cwd=it, check=True)
    subprocess.run(["gcc", "--coverage", "cost.o", "okid_core.o", "-lm", "-o", "cost"], cwd=it, check=True)
    return it


@lru_cache(maxsize=32)
def lines_run(folder: Path, n_u: int, n_y: int, p: int, count: int) -> int:
    counts = folder / "okid_core.gcda"
    counts.unlink(missing_ok=True)
    subprocess.run(["./cost", *map(str, (n_u, n_y, p, count))], cwd=folder, check=True)
    gcov = ["gcov", "--json-format", "--stdout", counts.name]
    told = json.loads(subprocess.run(gcov, cwd=folder, check=True, stdout=subprocess.PIPE).stdout)
    return sum(line["count"] for file in told["files"] for line in file["lines"])


def a_sample(folder: Path, n_u: int, n_y: int, p: int, after: int = 1024) -> float:
    """Lines run for a sample, as the mean of 1024 of them."""
    return (lines_run(folder, n_u, n_y, p, after + 1024) - lines_run(folder, n_u, n_y, p, after)) / 1024


def test_a_sample_costs_m_squared_times_the_lags(folder: Path) -> None:
    """Twice the lags cost twice as much, twice the channels four times, with what a sample costs whatever its size."""
    base, lags, channels = a_sample(folder, 1, 3, 40), a_sample(folder, 1, 3, 81), a_sample(folder, 2, 6, 40)
    assert 1.5 * base < lags < 2.1 * base
    assert 3 * base < channels < 4.2 * base
    products = 4 * 4 * 41
    assert 0.5 * products < base < 4 * products, "the lines of the kernel for each product"


def test_a_sample_costs_the_same_however_long_the_record(folder: Path) -> None:
    assert a_sample(folder, 1, 3, 40, 1024) == pytest.approx(a_sample(folder, 1, 3, 40, 20480), rel=0.01)
