// SPDX-License-Identifier: MIT
// PURPOSE  the node that sums for a maximum-likelihood refinement: correlations of 16-bit codes with NODE_P past inputs; the host
//          that reads its state refines
// METHOD   in the place of identifier.c, behind the same line; it identifies nothing itself
#include "identifier.h"

#include <okid/correlation.h>

enum { WAITING = 16, RUNS = 2 };

static struct {
    okid_correlation_t* sums;
    uint32_t next; ///< number of the sample that comes next
    int32_t begun;
    char block[OKID_CORRELATION_BYTES(NODE_INPUTS, NODE_OUTPUTS, NODE_P, RUNS, WAITING)];
} state;
static uint8_t written[sizeof state.block]; // the state as bytes takes less: what waits is summed before

uint32_t identifier_state_bytes(void) { return sizeof state; }
uint32_t identifier_work_bytes(void) { return sizeof written; }

okid_status_t identifier_reset(void) {
    okid_correlation_config_t config = okid_correlation_defaults(NODE_INPUTS, NODE_OUTPUTS, NODE_P);
    config.sample = OKID_SAMPLE_INT16;
    config.slots = RUNS;
    config.buffer = WAITING;
    state.begun = 0;
    return okid_correlation_create(&state.sums, &config, state.block, sizeof state.block);
}

okid_status_t identifier_add(uint32_t first, const int16_t* codes, uint32_t count) {
    if (state.begun && first != state.next) okid_correlation_gap(state.sums, first - state.next);
    state.begun = 1;
    state.next = first + count;
    return okid_correlation_add_i16(state.sums, codes, count);
}

void identifier_run(double rate_hz, node_modes_t* out) {
    (void)rate_hz;
    *out = (node_modes_t){.status = OKID_ERR_NO_MODES};
}

size_t identifier_state(const uint8_t** bytes) {
    const size_t size = okid_correlation_serialised_size(state.sums);
    *bytes = written;
    if (size > sizeof written || okid_correlation_serialise(state.sums, written, sizeof written) != OKID_OK) return 0;
    return size;
}

void identifier_stats(okid_accumulator_stats_t* out) { okid_correlation_stats(state.sums, out); }
