// SPDX-License-Identifier: MIT
// CAN frames to modes, drivers and library: one force in frame 0x100, three accelerations in 0x101, both with a counter in
// their first 16 bits. The source is a candump -L log; drv_source_socketcan with interfaces = {"can0"} is a bus.
// usage: can_to_modes LOG RATE_HZ
#include <drv/codec.h>
#include <drv/source.h>
#include <okid/okid.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
enum { CHANNELS = 4, BATCH = 64 };
static const uint32_t frame_of[CHANNELS] = {0x100, 0x101, 0x101, 0x101};
static drv_signal_t counter = {.start_bit = 0, .length = 16, .scale = 1};
static drv_signal_t signals[CHANNELS] = {{.start_bit = 16, .length = 16, .is_signed = 1, .scale = 0.0002}, // N
                                         {.start_bit = 16, .length = 16, .is_signed = 1, .scale = 0.0006}, // m/s^2
                                         {.start_bit = 32, .length = 16, .is_signed = 1, .scale = 0.0005},
                                         {.start_bit = 48, .length = 16, .is_signed = 1, .scale = 0.0003}};

int main(int argc, char** argv) {
    if (argc != 3) return 2;
    const okid_identify_config_t how = okid_identify_defaults(1, 3, atof(argv[2]));
    okid_accumulator_config_t shape = okid_accumulator_defaults(1, 3, okid_identify_lags(&how));
    shape.edges = 1; // frames may be lost
    const size_t bytes[2] = {okid_accumulator_memsize(&shape), okid_identify_memsize(&how)};
    void* block[2] = {malloc(bytes[0]), malloc(bytes[1])};
    okid_accumulator_t* sums;
    okid_identify_t* identifier;
    drv_source_t log = {.ops = &drv_source_replay};
    const drv_source_config_t from = {.path = argv[1]};
    if (!block[0] || !block[1] || okid_accumulator_create(&sums, &shape, block[0], bytes[0]) != OKID_OK ||
        okid_identify_create(&identifier, &how, block[1], bytes[1]) != OKID_OK)
        return 1;
    for (int c = -1; c < CHANNELS; ++c) drv_signal_prepare(c < 0 ? &counter : &signals[c]);
    if (log.ops->open(&log, &from) < 0) return fprintf(stderr, "%s\n", log.error), 1;
    drv_frame_t frames[BATCH];
    double sample[CHANNELS] = {NAN, NAN, NAN, NAN}, number = 0;
    okid_status_t status = OKID_OK;
    for (int n, last = -1; (n = log.ops->read(&log, frames, BATCH)) >= 0 && status >= 0;)
        for (int i = 0; i < n && status >= 0; ++i) {
            const drv_frame_t* f = &frames[i];
            if (!drv_signal_decode(&counter, f->data, f->len, &number)) continue;
            if (last >= 0 && (int)number != last) { // a new sample begins: the one before is whole, or a NaN tells
                status = okid_accumulator_add(sums, sample, 1);
                const int missing = ((int)number - last - 1) & 0xFFFF;
                if (missing > 0) okid_accumulator_gap(sums, missing);
                sample[0] = sample[1] = sample[2] = sample[3] = NAN;
            }
            last = (int)number;
            for (int c = 0; c < CHANNELS; ++c)
                if (f->id == frame_of[c]) drv_signal_decode(&signals[c], f->data, f->len, &sample[c]);
        }
    log.ops->close(&log);
    okid_identified_t found;
    if (status < 0 || (status = okid_identify_run(identifier, sums, &found)) < 0)
        return fprintf(stderr, "%s\n", okid_status_text(status)), 1;
    for (int k = 0; k < found.mode_count; ++k)
        if (found.emac[k] > 0.5) printf("%.4f Hz, %.3f %%\n", found.frequency_hz[k], 100 * found.damping_ratio[k]);
    return 0;
}
