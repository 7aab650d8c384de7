// SPDX-License-Identifier: MIT
// PURPOSE  a sensor node that identifies its own structure: frames in over the serial line, modes out
// METHOD   packets of samples are summed as they come; a command identifies, or sends what was summed or counted
#include "board.h"
#include "identifier.h"
#include "link.h"
#include "stack.h"

#include <string.h>

#ifndef NODE_RATE_HZ
#define NODE_RATE_HZ 152.20657039571532 // of rig W1
#endif

static uint32_t packets, damaged, summing, identifying;

static uint8_t* put(uint8_t* at, const void* value, size_t bytes) { // little-endian, as the processor is
    memcpy(at, value, bytes);
    return at + bytes;
}

static uint8_t* put_numbers(uint8_t* at, const double* numbers, size_t count) {
    return put(at, numbers, count * sizeof *numbers);
}

static void send_modes(void) {
    static uint8_t bytes[12 + 8 * (2 + NODE_VALUES + NODE_DOFS * (6 + 2 * NODE_OUTPUTS))];
    static node_modes_t modes;
    const uint32_t start = board_ticks();
    identifier_run(NODE_RATE_HZ, &modes);
    identifying = board_ticks() - start;
    const int32_t head[3] = {(int32_t)modes.status, modes.stage, modes.count};
    uint8_t* at = put(bytes, head, sizeof head);
    at = put_numbers(at, &modes.radius, 1);
    at = put_numbers(at, &modes.ridge, 1);
    at = put_numbers(at, modes.singular_values, NODE_VALUES);
    for (int32_t k = 0; k < modes.count; ++k) {
        at = put_numbers(at, &modes.mode[k].frequency_hz, 1);
        at = put_numbers(at, &modes.mode[k].damping_ratio, 1);
        at = put_numbers(at, &modes.mode[k].frequency_std_hz, 1);
        at = put_numbers(at, &modes.mode[k].damping_ratio_std, 1);
        at = put_numbers(at, &modes.mode[k].mpc, 1);
        at = put_numbers(at, &modes.mode[k].emac, 1);
        at = put_numbers(at, modes.mode[k].shape_re, NODE_OUTPUTS);
        at = put_numbers(at, modes.mode[k].shape_im, NODE_OUTPUTS);
    }
    link_report(LINK_REPORT_MODES, bytes, (size_t)(at - bytes));
}

static void send_state(void) {
    const uint8_t* bytes = NULL;
    const size_t size = identifier_state(&bytes);
    link_report(LINK_REPORT_STATE, bytes, size);
}

static void send_counts(void) {
    okid_accumulator_stats_t stats;
    identifier_stats(&stats);
    const uint32_t counts[] = {NODE_P,
                               sizeof(okid_real_t),
                               packets,
                               damaged,
                               (uint32_t)stats.samples,
                               (uint32_t)stats.missing,
                               (uint32_t)stats.rows,
                               board_tick_hz(),
                               link_ticks(),
                               summing,
                               identifying,
                               identifier_state_bytes(),
                               identifier_work_bytes(),
                               stack_used(),
                               stack_room()};
    link_report(LINK_REPORT_COUNTS, (const uint8_t*)counts, sizeof counts);
}

static void obey(uint8_t command) {
    switch (command) {
    case LINK_RESET: (void)identifier_reset(); break;
    case LINK_IDENTIFY: send_modes(); break;
    case LINK_STATE: send_state(); break;
    case LINK_COUNTS: send_counts(); break;
    default: break;
    }
}

int main(void) {
    board_start();
    if (identifier_reset() != OKID_OK) return 1; // cannot be: the sizes are constants
    send_counts();                               // says that the line is up
    for (;;) {
        link_samples_t samples;
        uint8_t command = 0;
        switch (link_receive(NODE_CHANNELS, &samples, &command)) {
        case LINK_SAMPLES: {
            const uint32_t start = board_ticks();
            (void)identifier_add(samples.sequence, samples.codes, samples.count);
            summing += board_ticks() - start;
            ++packets;
            break;
        }
        case LINK_COMMAND: obey(command); break;
        default: ++damaged; break;
        }
    }
}
