// SPDX-License-Identifier: MIT
// A program of somebody else that uses the library: 16-bit codes of a file to a model, as JSON on one line.
// usage: identify_codes FILE INPUTS OUTPUTS RATE_HZ METHOD   (codes sample by sample, inputs first; method 0..4)
#include <okid/okid.h>

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

enum { LAGS = 20, ORDER = 6 };

static void print_numbers(const char* name, const okid_real_t* numbers, int count) {
    printf("\"%s\":[", name);
    for (int i = 0; i < count; ++i) printf("%s%.17g", i ? "," : "", (double)numbers[i]);
    printf("],");
}

static void print_result(const okid_identified_t* r) {
    printf("{");
    print_numbers("singular_values", r->singular_values, r->singular_count);
    print_numbers("markov", r->markov, r->markov_count * r->n_y * r->n_u);
    print_numbers("innovation", r->innovation, r->n_y * r->n_y);
    print_numbers("frequency_hz", r->frequency_hz, r->mode_count);
    print_numbers("damping_ratio", r->damping_ratio, r->mode_count);
    print_numbers("mpc", r->mpc, r->mode_count);
    print_numbers("emac", r->emac, r->mode_count);
    print_numbers("shape_re", r->shape_re, r->mode_count * r->n_y);
    print_numbers("shape_im", r->shape_im, r->mode_count * r->n_y);
    printf("\"order\":%" PRId32 ",\"rows\":%" PRId64 ",\"backend\":\"%s\"}\n", r->n_z, r->regression_rows,
           okid_backend());
}

/// All of a file; NULL when it cannot be read.
static int16_t* read_codes(const char* path, size_t* count) {
    FILE* file = fopen(path, "rb");
    if (!file) return NULL;
    int16_t* codes = NULL;
    if (fseek(file, 0, SEEK_END) == 0) {
        const long bytes = ftell(file);
        rewind(file);
        codes = bytes > 0 ? malloc((size_t)bytes) : NULL;
        *count = codes ? fread(codes, sizeof *codes, (size_t)bytes / sizeof *codes, file) : 0;
    }
    fclose(file);
    return codes;
}

static okid_status_t identify(const okid_identify_config_t* config, const int16_t* codes, size_t samples) {
    const okid_accumulator_config_t sums = {.n_u = config->n_u,
                                            .n_y = config->n_y,
                                            .lags = okid_identify_lags(config),
                                            .sample = OKID_SAMPLE_INT16,
                                            .forgetting = 1};
    const size_t bytes[2] = {okid_accumulator_memsize(&sums), okid_identify_memsize(config)};
    void* block[2] = {malloc(bytes[0]), malloc(bytes[1])};
    okid_accumulator_t* accumulator = NULL;
    okid_identify_t* identifier = NULL;
    okid_identified_t result;
    okid_status_t status = block[0] && block[1] ? OKID_OK : OKID_ERR_MEMORY;
    if (status >= 0) status = okid_accumulator_create(&accumulator, &sums, block[0], bytes[0]);
    if (status >= 0) status = okid_identify_create(&identifier, config, block[1], bytes[1]);
    if (status >= 0) status = okid_accumulator_add_i16(accumulator, codes, samples);
    if (status >= 0) status = okid_identify_run(identifier, accumulator, &result);
    if (status >= 0) print_result(&result);
    free(block[0]);
    free(block[1]);
    return status;
}

int main(int argc, char** argv) {
    if (argc != 6) {
        fprintf(stderr, "usage: identify_codes FILE INPUTS OUTPUTS RATE_HZ METHOD\n");
        return 2;
    }
    const okid_identify_config_t config = {.n_u = atoi(argv[2]),
                                           .n_y = atoi(argv[3]),
                                           .p = LAGS,
                                           .order = ORDER,
                                           .fs_hz = atof(argv[4]),
                                           .method = (okid_method_t)atoi(argv[5]),
                                           .detrend = OKID_DETREND_MEAN};
    size_t count = 0;
    int16_t* codes = read_codes(argv[1], &count);
    if (!codes || config.n_u + config.n_y < 1) {
        fprintf(stderr, "identify_codes: %s: no codes, or no channels\n", argv[1]);
        return 2;
    }
    const okid_status_t status = identify(&config, codes, count / (size_t)(config.n_u + config.n_y));
    if (status < 0) fprintf(stderr, "identify_codes: %s: %s\n", argv[1], okid_status_text(status));
    free(codes);
    return status < 0 ? 3 : 0;
}
