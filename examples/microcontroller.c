// SPDX-License-Identifier: MIT
// A firmware's loop in static memory: codes are summed as the converter delivers them, modes follow from the sums by single
// steps. Here the converter is standard input: 16-bit codes of one force and three accelerometers.
#include <okid/accumulator.h>
#include <okid/modal.h>
#include <okid/steps/era.h>
#include <okid/steps/observer.h>

#include <stdio.h>

enum { NU = 1, NY = 3, M = NU + NY, P = 20, NZ = 6, MODES = NZ / 2 };
static char sums_block[OKID_ACCUMULATOR_CODES_BYTES(NU, NY, P)];
static union { // observer and realization never meet
    char observer[OKID_STRUCTURED_BYTES(NU, NY, P)];
    char era[OKID_ERA_BYTES(NU, NY, P, P)];
} work;
static char modal_work[OKID_MODAL_BYTES(NZ)];
static double S[M * M * (P + 1)], head[M * P], tail[M * P], sum[M];
static okid_real_t theta[NY * (NU + P * M)], markov[NY * NU * (2 * P + 1)], A[NZ * NZ], B[NZ * NU], C[NY * NZ];
static okid_real_t frequency[MODES], damping[MODES];

static okid_status_t identify(okid_accumulator_t* sums, double rate_hz, okid_modes_t* modes) {
    const okid_observer_config_t observer = okid_observer_defaults(NU, NY, P);
    const okid_era_config_t realization = okid_era_defaults(NU, NY, P);
    okid_run_sums_t run = {S, head, tail, sum, NULL, 0};
    okid_observer_info_t info;
    okid_era_t* era = NULL;
    okid_status_t status = okid_accumulator_run(sums, OKID_DETREND_MEAN, &run);
    if (status >= 0)
        status = okid_structured_solve(&observer, OKID_DETREND_MEAN, &run, theta, NULL, &info, work.observer,
                                       sizeof work.observer);
    if (status >= 0) status = okid_markov_recursion(NU, NY, P, theta, 2 * P, markov, NULL);
    if (status >= 0) status = okid_era_create(&era, &realization, work.era, sizeof work.era);
    if (status >= 0) status = okid_era_decompose(era, markov);
    if (status >= 0) status = okid_era_realize(era, NZ, A, B, C, NULL, NULL);
    const okid_model_t model = {.n_u = NU, .n_y = NY, .n_z = NZ, .A = A, .B = B, .C = C};
    return status < 0 ? status : okid_modal_analyse(&model, 1 / rate_hz, modes, modal_work, sizeof modal_work);
}

int main(void) {
    okid_accumulator_config_t config = okid_accumulator_defaults(NU, NY, P);
    config.sample = OKID_SAMPLE_INT16;
    config.buffer = 1; // no samples wait: least memory
    okid_accumulator_t* sums = NULL;
    if (okid_accumulator_create(&sums, &config, sums_block, sizeof sums_block) != OKID_OK) return 1;
    int16_t codes[M];
    okid_modes_t modes = {.frequency_hz = frequency, .damping_ratio = damping};
    for (long n = 1; fread(codes, sizeof codes, 1, stdin) == 1; ++n) { // in a firmware: the interrupt of the converter
        if (okid_accumulator_add_i16(sums, codes, 1) < 0) return 1;
        if (n % 2500 != 0 || identify(sums, 250.0, &modes) < 0) continue; // every ten seconds
        printf("after %ld samples:", n);
        for (int k = 0; k < modes.count; ++k) printf(" %.3f Hz %.2f %%", frequency[k], 100 * damping[k]);
        printf("\n");
    }
    return 0;
}
