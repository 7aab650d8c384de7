// SPDX-License-Identifier: MIT
// Modes of the last seconds of a stream, block by block: doubles on standard input, inputs first, NaN = missing.
// usage: blocks_from_stream INPUTS OUTPUTS RATE_HZ WINDOW_S < samples
#include <okid/okid.h>

#include <stdio.h>
#include <stdlib.h>

enum { BLOCKS = 20, CHANNELS = 16 }; // of a window; at most

int main(int argc, char** argv) {
    if (argc != 5 || atoi(argv[1]) + atoi(argv[2]) > CHANNELS) {
        fprintf(stderr, "usage: blocks_from_stream INPUTS OUTPUTS RATE_HZ WINDOW_S < samples\n");
        return 2;
    }
    const double rate_hz = atof(argv[3]);
    const okid_identify_config_t how = okid_identify_defaults(atoi(argv[1]), atoi(argv[2]), rate_hz);
    okid_accumulator_config_t window = okid_accumulator_defaults(how.n_u, how.n_y, okid_identify_lags(&how));
    window.block = (int32_t)(rate_hz * atof(argv[4]) / BLOCKS);
    window.slots = BLOCKS;
    window.spare_slots = BLOCKS; // every gap closes a block early
    window.edges = 1;            // gaps

    const size_t bytes[2] = {okid_accumulator_memsize(&window), okid_identify_memsize(&how)};
    const size_t sample_bytes = (size_t)(how.n_u + how.n_y) * sizeof(double);
    void *block[2] = {malloc(bytes[0]), malloc(bytes[1])}, *samples = malloc((size_t)window.block * sample_bytes);
    okid_accumulator_t* sums = NULL;
    okid_identify_t* identifier = NULL;
    if (!block[0] || !block[1] || !samples || okid_accumulator_create(&sums, &window, block[0], bytes[0]) != OKID_OK ||
        okid_identify_create(&identifier, &how, block[1], bytes[1]) != OKID_OK) {
        fprintf(stderr, "an invalid configuration, or no memory\n");
        return 1;
    }
    size_t count, total = 0;
    while ((count = fread(samples, sample_bytes, (size_t)window.block, stdin)) > 0) {
        okid_identified_t found;
        okid_status_t status = okid_accumulator_add(sums, samples, count);
        total += count;
        if (status >= 0) status = okid_identify_run(identifier, sums, &found);
        printf("%.1f s:", (double)total / rate_hz);
        if (status < 0) printf(" %s", okid_status_text(status)); // at the beginning: too short
        for (int k = 0; status >= 0 && k < found.mode_count; ++k)
            if (found.emac[k] > 0.9) printf(" %.3f Hz", found.frequency_hz[k]);
        printf("\n");
    }
    free(block[0]);
    free(block[1]);
    free(samples);
    return 0;
}
