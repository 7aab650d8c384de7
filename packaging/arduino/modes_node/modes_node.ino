// SPDX-License-Identifier: MIT
// Identifies on the board: sums 1 force (A0) and 3 accelerations (A1 to A3) at 1 kHz and prints three modes every 3,000
// samples. 60 KiB of RAM in double; C++17 and the library Eigen. While it identifies it takes no samples; then it starts new sums.
#include <Eigen/Core> // so that the build finds that library
#include <okid_modes.h>

enum { NU = 1, NY = 3, M = NU + NY, P = 20, NZ = 6, WAITING = 16, PERIOD_US = 1000, EVERY = 3000 };
static const uint8_t pins[M] = {A0, A1, A2, A3};
static char sums_block[OKID_ACCUMULATOR_CODES_BYTES(NU, NY, P) + 8 * M * WAITING];
static okid_accumulator_t* sums;
static uint32_t number, next_us;

static double S[M * M * (P + 1)], head[M * P], tail[M * P], sum[M];
static okid_real_t theta[NY * (NU + P * M)], markov[NY * NU * (2 * P + 1)], A[NZ * NZ], B[NZ * NU], C[NY * NZ];
static okid_real_t frequency[NZ / 2], damping[NZ / 2];
static union { // observer and realization never meet
    char observer[OKID_STRUCTURED_BYTES(NU, NY, P)];
    char era[OKID_ERA_BYTES(NU, NY, P, P)];
    char modal[OKID_MODAL_BYTES(NZ)];
} work;

static okid_status_t identify(okid_modes_t* modes) {
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
    okid_model_t model = {};
    model.n_u = NU;
    model.n_y = NY;
    model.n_z = NZ;
    model.A = A;
    model.B = B;
    model.C = C;
    return status < 0 ? status : okid_modal_analyse(&model, PERIOD_US * 1e-6, modes, work.modal, sizeof work.modal);
}

static void tell() {
    okid_modes_t modes = {};
    modes.frequency_hz = frequency;
    modes.damping_ratio = damping;
    const okid_status_t status = identify(&modes);
    if (status < 0) Serial.println(okid_status_text(status));
    for (int k = 0; status >= 0 && k < modes.count; ++k) {
        Serial.print(frequency[k], 4);
        Serial.print(" Hz ");
        Serial.print(100 * damping[k], 3);
        Serial.println(" %");
    }
}

void setup() {
    Serial.begin(115200);
    analogReadResolution(12);
    okid_accumulator_config_t config = okid_accumulator_defaults(NU, NY, P);
    config.sample = OKID_SAMPLE_INT16;
    config.buffer = WAITING;
    if (okid_accumulator_create(&sums, &config, sums_block, sizeof sums_block) != OKID_OK) Serial.println("no room");
    next_us = micros();
}

void loop() {
    const uint32_t now_us = micros();
    if ((int32_t)(now_us - next_us) < 0) return;
    const uint32_t late = (now_us - next_us) / PERIOD_US; // samples that were not taken
    if (late > 0) okid_accumulator_gap(sums, late);
    next_us += PERIOD_US * (late + 1);
    int16_t codes[M];
    for (int c = 0; c < M; ++c) codes[c] = (int16_t)(analogRead(pins[c]) - 2048);
    (void)!okid_accumulator_add_i16(sums, codes, 1);
    if (++number % EVERY == 0) tell();
}
