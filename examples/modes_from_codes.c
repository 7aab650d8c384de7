// SPDX-License-Identifier: MIT
// Modes from 16-bit codes of a file, sample by sample, inputs first.
// usage: modes_from_codes FILE INPUTS OUTPUTS RATE_HZ
#include <okid/okid.h>

#include <stdio.h>
#include <stdlib.h>

static void check(okid_status_t status, const char* what) {
    if (status >= OKID_OK) return; // above 0: a warning, the result is valid
    fprintf(stderr, "%s: %s\n", what, okid_status_text(status));
    exit(1);
}

static void* block_of(size_t bytes) {
    void* block = bytes > 0 ? malloc(bytes) : NULL;
    if (!block) check(OKID_ERR_MEMORY, "a configuration that is invalid or too large");
    return block;
}

int main(int argc, char** argv) {
    if (argc != 5) {
        fprintf(stderr, "usage: modes_from_codes FILE INPUTS OUTPUTS RATE_HZ\n");
        return 2;
    }
    const int n_u = atoi(argv[2]), n_y = atoi(argv[3]);
    const okid_identify_config_t how = okid_identify_defaults(n_u, n_y, atof(argv[4]));
    okid_accumulator_config_t shape = okid_accumulator_defaults(n_u, n_y, okid_identify_lags(&how));
    shape.sample = OKID_SAMPLE_INT16;

    okid_accumulator_t* sums = NULL;
    okid_identify_t* identifier = NULL;
    size_t bytes = okid_accumulator_memsize(&shape);
    void* sums_block = block_of(bytes);
    check(okid_accumulator_create(&sums, &shape, sums_block, bytes), "accumulator");
    bytes = okid_identify_memsize(&how);
    void* identifier_block = block_of(bytes);
    check(okid_identify_create(&identifier, &how, identifier_block, bytes), "identifier");

    FILE* file = fopen(argv[1], "rb");
    if (!file) return perror(argv[1]), 1;
    int16_t codes[256 * 16]; // as they arrive: any number of samples at a time
    const size_t channels = (size_t)(n_u + n_y), most = sizeof codes / sizeof *codes / channels;
    for (size_t n; (n = fread(codes, channels * sizeof *codes, most, file)) > 0;)
        check(okid_accumulator_add_i16(sums, codes, n), argv[1]);
    fclose(file);

    okid_identified_t found;
    check(okid_identify_run(identifier, sums, &found), "identification");
    for (int k = 0; k < found.mode_count; ++k)
        if (found.emac[k] > 0.5)
            printf("%.4f Hz, damping %.3f %%\n", found.frequency_hz[k], 100 * found.damping_ratio[k]);
    free(sums_block);
    free(identifier_block);
    return 0;
}
