// SPDX-License-Identifier: MIT
// PURPOSE  okid_core.c on any processor: a record goes into three kinds of sums, the CRC of each state comes out as a line
// METHOD   codes.h, written by the test, holds `static const int16_t codes[SAMPLES][4]`, force first. Line: name, bytes of the
//          state, its last four (the CRC-32), instructions a sample where board_tick_hz() tells (board.h)
#include "board.h"
#include "codes.h"
#include "okid_core.h"

enum { NU = 1, NY = 3, M = NU + NY, P = 20, LAGS = 100, FIRST = 1200, MISSING = 5, RUNS = 2, PIECE = 16 };
static char block[OKID_CORRELATION_BYTES(NU, NY, LAGS, RUNS, PIECE) + OKID_ACCUMULATOR_CODES_BYTES(NU, NY, P)];
static uint8_t written[sizeof block];

static void text(const char* at) {
    while (*at) board_write((uint8_t)*at++);
}

static void number(uint32_t value, uint32_t base) {
    char digits[12], *at = digits + sizeof digits;
    *--at = 0;
    do *--at = "0123456789abcdef"[value % base];
    while ((value /= base) > 0);
    text(" ");
    text(at);
}

static void tell(const char* name, okid_status_t status, size_t bytes, uint32_t ticks) {
    text(name);
    if (status < OKID_OK) {
        text(" ");
        text(okid_status_text(status));
    } else {
        uint32_t crc = 0;
        for (size_t i = 1; i <= 4; ++i) crc = crc << 8 | written[bytes - i];
        number((uint32_t)bytes, 10);
        number(crc, 16);
        number((uint32_t)((double)ticks * 1e9 / board_tick_hz() / SAMPLES), 10);
    }
    text("\n");
}

/// One run, p = 20, as a node of tests/embedded sums it; 24: the codes times 256 plus their number, in 32-bit words.
static void sums(const char* name, okid_sample_t sample) {
    okid_accumulator_t* a = NULL;
    okid_accumulator_config_t config = okid_accumulator_defaults(NU, NY, P);
    config.sample = sample;
    config.buffer = PIECE;
    okid_status_t status = okid_accumulator_create(&a, &config, block, sizeof block);
    const uint32_t start = board_ticks();
    for (int n = 0; n < SAMPLES && status >= 0; n += PIECE) {
        const size_t count = SAMPLES - n < PIECE ? SAMPLES - n : PIECE;
        if (sample == OKID_SAMPLE_INT16) {
            status = okid_accumulator_add_i16(a, codes[n], count);
            continue;
        }
        int32_t wide[PIECE * M];
        for (int i = 0; i < (int)count * M; ++i) wide[i] = codes[n + i / M][i % M] * 256 + (n + i / M) % 256;
        status = okid_accumulator_add_i32(a, wide, count);
    }
    const uint32_t ticks = board_ticks() - start;
    if (status >= 0) status = okid_accumulator_serialise(a, written, sizeof written);
    tell(name, status, status < 0 ? 0 : okid_accumulator_serialised_size(a), ticks);
}

/// Two runs, cut into calls of PIECE samples.
static void correlations(void) {
    okid_correlation_t* s = NULL;
    okid_correlation_config_t config = okid_correlation_defaults(NU, NY, LAGS);
    config.sample = OKID_SAMPLE_INT16;
    config.slots = RUNS;
    config.buffer = PIECE;
    okid_status_t status = okid_correlation_create(&s, &config, block, sizeof block);
    const uint32_t start = board_ticks();
    for (int n = 0; n < SAMPLES && status >= 0; n += PIECE) {
        if (n == FIRST) okid_correlation_gap(s, MISSING);
        status = okid_correlation_add_i16(s, codes[n], (size_t)(SAMPLES - n < PIECE ? SAMPLES - n : PIECE));
    }
    const uint32_t ticks = board_ticks() - start;
    if (status >= 0) status = okid_correlation_serialise(s, written, sizeof written);
    tell("correlation", status, status < 0 ? 0 : okid_correlation_serialised_size(s), ticks);
}

int main(void) {
    board_start();
    sums("sums16", OKID_SAMPLE_INT16);
    sums("sums24", OKID_SAMPLE_INT24);
    correlations();
    text("end\n");
    return 0;
}
